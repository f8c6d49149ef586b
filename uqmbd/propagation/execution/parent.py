"""Processes that end with the one that started them, however that ends."""

from __future__ import annotations

import os
import threading

__all__ = ["end_with_parent"]


def end_with_parent() -> None:
    """Let this process end at once when its parent has, which may be killed without a chance to say so.

    The operating system closes what the parent holds open; a thread waits for that.
    """
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_wait, args=(parent.sentinel,), name="uqmbd: end with parent", daemon=True).start()


def _wait(sentinel: int) -> None:
    from multiprocessing.connection import wait

    wait([sentinel])
    os._exit(1)

"""Processes that end with their parent process, even if it is killed."""

from __future__ import annotations

import os
import threading

__all__ = ["end_with_parent"]


def end_with_parent() -> None:
    """Make this process end as soon as its parent process ends, even if the parent is killed.

    The operating system closes the open files of the parent; a thread of this process waits until they are closed.
    """
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_wait, args=(parent.sentinel,), name="uqmbd: end with parent", daemon=True).start()


def _wait(sentinel: int) -> None:
    from multiprocessing.connection import wait

    wait([sentinel])
    os._exit(1)

"""Errors and warnings for the terminal: one message, and an exit status for scripts."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from uqmbd.errors import StudyError, UqmbdError

__all__ = ["FAILED", "INTERRUPTED", "UNMET", "UNUSABLE", "explained", "warnings_as_lines"]

FAILED = 1
UNUSABLE = 2
UNMET = 3  # the computation is complete, but a requirement is not met
INTERRUPTED = 130  # 128 + SIGINT, as shells have it


@contextmanager
def explained(*, debug: bool) -> Iterator[None]:
    """Convert an exception to a message on the standard error stream and an exit status; `debug` adds the traceback."""
    try:
        with warnings_as_lines():
            yield
    except SystemExit as error:
        # the command-line library converts Ctrl-C to this status without a message
        if error.code == INTERRUPTED:
            print("Interrupted.", file=sys.stderr, flush=True)
        raise
    except KeyboardInterrupt as error:
        _leave(error, "Interrupted.", INTERRUPTED, debug=debug)
    except StudyError as error:
        # if no method succeeded, the status is FAILED, even if the reason is an error in the study
        _leave(error, f"Error: {error}", FAILED if error.failed else UNUSABLE, debug=debug)
    except UqmbdError as error:
        _leave(error, f"Error: {error}", FAILED, debug=debug)
    except OSError as error:
        # unreadable files or unreachable ports are errors in the input of the command
        _leave(error, f"Error: {_os_error(error)}", UNUSABLE, debug=debug)
    except MemoryError as error:
        _leave(error, "Error: out of memory; try fewer samples, outputs, times or workers.", FAILED, debug=debug)
    except Exception as error:
        hint = "" if debug else " Run the command with --debug for a traceback, and report the error."
        message = f"Error: {type(error).__name__}: {error}\nThe error is in uqmbd, in a plugin or in the study."
        _leave(error, message + hint, FAILED, debug=debug)


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Show warnings as `Warning: text` while the context lasts, each text once."""
    seen: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        ours = issubclass(category, UserWarning)
        text = f"Warning: {message}" if ours else f"Warning: {category.__name__}: {message} ({filename}, line {lineno})"
        if text not in seen:
            seen.add(text)
            print(text, file=file or sys.stderr, flush=True)

    before = warnings.showwarning
    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = before


def _leave(error: BaseException, message: str, status: int, *, debug: bool) -> None:
    if debug:
        import traceback

        traceback.print_exception(error, file=sys.stderr)
    print("\n".join([message, *getattr(error, "__notes__", ())]), file=sys.stderr, flush=True)
    raise SystemExit(status) from None


def _os_error(error: OSError) -> str:
    if error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__

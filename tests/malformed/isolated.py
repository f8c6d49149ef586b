"""Runs cases in a process of its own, so that one that ends the process is seen: ``python -m tests.malformed.isolated``.

Case numbers come by standard input, one a line; of each the parent is told when it begins and how it ended.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import time
import traceback
import warnings
from typing import Any

SECONDS = 60
"""After which a case counts as one that hangs."""


class Hangs(BaseException):
    """A case that does not end."""


def outcome(case: Any) -> dict[str, Any]:
    """Run a case, and say how it ended and what it said on the way."""
    import uqmbd

    def alarm(*_: Any) -> None:
        raise Hangs

    found: dict[str, Any] = {"fate": "computed", "message": "", "trace": ""}
    with warnings.catch_warnings(record=True) as caught, tempfile.TemporaryFile("w+") as heard:
        warnings.simplefilter("always")
        sys.stdout.flush(), sys.stderr.flush()
        streams = [os.dup(1), os.dup(2)]
        for k in (1, 2):
            os.dup2(heard.fileno(), k)
        old = signal.signal(signal.SIGALRM, alarm)
        signal.alarm(SECONDS)
        try:
            case.run()
        except uqmbd.StudyError as error:
            found |= {"fate": "refused", "message": str(error)}
        except uqmbd.UqmbdError as error:
            found |= {"fate": "failed", "message": str(error)}
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is told
            frames = traceback.extract_tb(error.__traceback__)[-3:]
            where = " < ".join(f"{os.path.basename(f.filename)}:{f.lineno}" for f in reversed(frames))
            found |= {"fate": "mistake", "message": f"{type(error).__name__}: {error}", "trace": where}
        finally:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, old)
            sys.stdout.flush(), sys.stderr.flush()
            for k, stream in zip((1, 2), streams, strict=True):
                os.dup2(stream, k)
                os.close(stream)
        heard.seek(0)
        found["heard"] = heard.read()
    foreign = [
        w
        for w in caught
        if not issubclass(w.category, UserWarning) or w.category.__module__ not in ("builtins", "uqmbd.errors")
    ]
    found["warnings"] = [
        f"{w.category.__name__}: {w.message} ({os.path.basename(w.filename)}:{w.lineno})" for w in foreign
    ]
    return found


def main() -> None:
    from .mutations import cases

    everything = {case.name: case for case in cases()}
    out = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        name = json.loads(line)
        print(json.dumps({"begin": name}), file=out, flush=True)
        begin = time.perf_counter()
        found = outcome(everything[name])
        print(json.dumps({"name": name, "seconds": time.perf_counter() - begin, **found}), file=out, flush=True)


if __name__ == "__main__":
    main()

"""Child process of the viewer: run the study script, and answer requests about its mechanism.

Requests and answers are lines of JSON on the standard streams.  Output of the script goes to the standard error stream.
The process ends as soon as its standard input ends, even if the script does not return.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from uqmbd.garbage_collection import loading
from uqmbd.viewer.child import UNPREPARED
from uqmbd.viewer.messages import Answer, as_json

if TYPE_CHECKING:
    from uqmbd.viewer.session import Session

__all__ = ["main"]


def main() -> None:
    """Answer requests until the standard input ends."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    requests: queue.Queue[str] = queue.Queue()
    source = os.fdopen(os.dup(0), "r", encoding="utf-8")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(2, 1)
    os.dup2(nothing, 0)
    threading.Thread(target=_read, args=(source, requests), daemon=True).start()
    prepared = UNPREPARED not in sys.argv[1:]
    del sys.argv[1:]  # scripts may read their arguments
    with loading():
        if prepared:
            _prepare()
        else:
            import uqmbd.viewer.session  # noqa: F401 - while the parent process imports its command line
    _send(answers, {"kind": "ready"})
    session: Session | None = None
    while True:
        request = json.loads(requests.get())
        if request.get("do") == "load":
            session = _load(Path(request["file"]), answers)
        elif session is None:
            _send(answers, {"kind": "refused", "message": "No study is loaded.", "number": request.get("number")})
        else:
            _send(answers, session.answer(request))
        _send(answers, {"kind": "done"})


def _read(source: TextIO, requests: queue.Queue[str]) -> None:
    """Queue the lines of a stream; end this process when the stream ends, because its parent has ended."""
    for line in source:
        requests.put(line)
    os._exit(0)


def _prepare() -> None:
    """Import the modules that every script needs, by drawing and checking a mechanism of one body."""
    import uqmbd
    from uqmbd import plugins
    from uqmbd.viewer.session import Session

    plugins.propagators()
    mechanism = uqmbd.Mechanism("stone", uqmbd.Planar(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", uqmbd.tolerance(1.0, 0.1, 0.1))
    stone = mechanism.body("stone", mass=1, inertia=length, angle=length)
    mechanism.output("height", stone.position[1])
    for _ in Session(mechanism, uqmbd.Study("fall", mechanism, [0, 1])).opening():
        pass


def _load(file: Path, answers: TextIO) -> Session | None:
    """Run the script; send scene and findings, or the error, with the files imported from the script's folder."""
    with loading():
        from uqmbd.viewer.session import failure, loaded
    try:
        with loading():
            session = loaded(file)
        for answer in session.opening():
            _send(answers, answer | {"files": _files(file)})
        return session
    except (Exception, SystemExit) as error:
        _send(answers, failure(error, file) | {"files": _files(file)})
        return None


def _files(script: Path) -> list[str]:
    """Return the script, and imported modules in its folder."""
    folder = script.resolve().parent
    known = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
    inside = {str(Path(one).resolve()) for one in known if isinstance(one, str) and one.endswith(".py")}
    return sorted({str(script.resolve()), *(one for one in inside if Path(one).is_relative_to(folder))})


def _send(answers: TextIO, answer: Answer) -> None:
    answers.write(as_json(answer) + "\n")
    answers.flush()


if __name__ == "__main__":
    main()

"""Viewer of a study file, which runs again when the file is saved, and viewer of a mechanism in a notebook."""

from __future__ import annotations

import contextlib
import threading
import time
import webbrowser
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError
from uqmbd.viewer.child import Child, ChildEnded, ChildTimeout, first_child
from uqmbd.viewer.messages import Answer
from uqmbd.viewer.server import PageServer

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism
    from uqmbd.viewer.session import Session

__all__ = ["FileViewer", "MechanismView", "view_mechanism", "view_study"]

POLL = 0.05
"""Interval at which the viewer checks the files of the study for changes, s."""

MOTION = 6.0
"""Time limit of a motion, as a multiple of the time limit of the study file."""


def view_study(script: Path, *, seconds: float = 10.0, port: int = 0, opened: bool = True) -> None:
    """Show the mechanism of a study file until the page is closed, or Escape or Ctrl-C is pressed.

    `seconds` is the time limit of the study file. `opened` opens the page in the browser.
    """
    if not seconds > 0:
        raise StudyError(f"--timeout {seconds:g}: expected a positive number of seconds.")
    try:
        viewer = FileViewer(script, seconds, port, first_child())
    except OSError as error:
        raise StudyError(f"--port {port}: {error}; choose another port, or omit --port.") from None
    try:
        print(viewer.server.address)
        print("To end: press Ctrl-C here or Escape on the page, or close the page.", flush=True)
        if opened:
            webbrowser.open(viewer.server.address)
        viewer.wait()
    except KeyboardInterrupt:
        pass
    finally:
        viewer.close()


class FileViewer:
    """Viewer of a study file; child processes run the file, each within a time limit.

    `child` is the first of these processes, if it was started earlier.
    """

    def __init__(self, script: Path, seconds: float, port: int = 0, child: Child | None = None) -> None:
        self.script = script
        self.seconds = seconds
        self.ended = threading.Event()
        self._wanted = threading.Event()
        self._requests: dict[str, Mapping[str, Any]] = {}
        self._files: dict[str, Any] = {str(script.resolve()): None}
        self._good: Child | None = None
        self._loading: Child | None = None
        self._spare: Child | None = child or Child(prepared=False)
        from uqmbd.viewer.page import viewer_page  # import while the child process starts

        page, nonce = viewer_page(str(script))
        try:
            self.server = PageServer(page, nonce, self._act, port=port)
        except OSError:
            self._spare.end()
            raise
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._watch, self._reply)]
        for work in self._threads:
            work.start()

    def wait(self) -> None:
        """Wait until the page ends the viewer, or no page is open."""
        while not self.ended.wait(POLL):
            if self.server.abandoned():
                return

    @property
    def prepared(self) -> bool:
        """Whether a process waits for the next version of the file."""
        return self._spare is not None and self._spare.ready.is_set()

    def close(self) -> None:
        """End the server and the child processes."""
        self.ended.set()
        self._wanted.set()
        self.server.close()
        for _ in range(2):  # the second pass ends children that the threads started during the first pass
            for child in (self._good, self._loading, self._spare):
                if child is not None:
                    child.end()
            for work in self._threads:
                work.join()

    def _act(self, request: Mapping[str, Any]) -> None:
        """Queue a request of the page; it replaces an unanswered request of the same kind."""
        if request.get("do") == "end":
            self.ended.set()
        elif request.get("do") in ("pose", "motion"):
            self._requests[str(request["do"])] = request
            self._wanted.set()

    def _watch(self) -> None:
        """Load the study at the start, and again after each change of its files."""
        self._files = {name: _state(name) for name in self._files}
        self._load()
        while not self.ended.wait(POLL):
            now = {name: _state(name) for name in self._files}
            if now != self._files:
                self._files = now
                self._load()

    def _load(self) -> None:
        """Run the study file in the spare process; if it succeeds, this process replaces the previous one."""
        child = self._loading = self._spare or Child()
        self._spare = None
        begin = time.monotonic()
        self._report("loading")
        previous: Child | None = child
        try:
            for answer in child.ask({"do": "load", "file": str(self.script)}, self.seconds):
                self._note_files(answer.pop("files", ()))
                if answer["kind"] == "error":
                    self._report("error", answer["message"], answer["line"])
                    continue
                if answer["kind"] == "scene":
                    previous, self._good = self._good, child
                    self._report("shown", seconds=time.monotonic() - begin)
                self.server.send(answer)
        except ChildTimeout:
            if self._good is child:
                text = f"The checks did not finish within {self.seconds:g} s; sliders do not work."
                answer = {"findings": [], "redundant": [], "mobility": None, "problem": text}
                self.server.send({"kind": "findings", **answer})
            else:
                text = f"The study file did not finish within {self.seconds:g} s, and was stopped."
                self._report("error", f"{text} Look for an endless loop, or choose a larger --timeout.")
            self._discard(child)
        except ChildEnded:
            if not self.ended.is_set():
                self._report("error", "The process of the study file ended unexpectedly.")
            self._discard(child)
        self._loading = None
        if previous is not None:
            previous.end()
        if not self.ended.is_set():
            self._spare = Child()  # start it only now, because its imports would delay the drawing
        self._wanted.set()

    def _discard(self, child: Child) -> None:
        """End a process that no longer answers."""
        child.end()
        if self._good is child:
            self._good = None

    def _note_files(self, names: Iterable[str]) -> None:
        for name in names:
            self._files.setdefault(name, _state(name))

    def _reply(self) -> None:
        """Answer the requests of the page by the process of the last study that loaded without an error."""
        while not self.ended.is_set():
            self._wanted.wait()
            self._wanted.clear()
            for kind in ("pose", "motion"):
                request, child = self._requests.pop(kind, None), self._good
                if request is None:
                    continue
                if child is None:
                    text = "No study is loaded; correct the file and save it."
                    self.server.send({"kind": "refused", "message": text, "of": kind, "number": request.get("number")})
                    continue
                limit = self.seconds * (MOTION if kind == "motion" else 1)
                number = {"number": request.get("number"), "of": kind}
                try:
                    for answer in child.ask(dict(request), limit):
                        self.server.send(answer)
                except ChildTimeout:
                    self._discard(child)
                    text = f"No answer within {limit:g} s; save the file to load it again."
                    self.server.send({"kind": "refused", "message": text, **number})
                except ChildEnded:
                    if child is not self._good:  # a new process replaced it, and the page adapts to its scene
                        continue
                    self._discard(child)
                    text = "The process of the study file ended; save the file to load it again."
                    self.server.send({"kind": "refused", "message": text, **number})

    def _report(self, state: str, message: str = "", line: int | None = None, seconds: float | None = None) -> None:
        text = {"kind": "status", "state": state, "message": message, "line": line, "seconds": seconds}
        self.server.send(text)


def _state(name: str) -> tuple[int, int] | None:
    """Return modification time and size of a file; None if the file does not exist."""
    with contextlib.suppress(OSError):
        found = Path(name).stat()
        return found.st_mtime_ns, found.st_size
    return None


class MechanismView:
    """Viewer of a mechanism in this process; notebooks show it as a frame."""

    def __init__(self, session: Session, height: int = 560) -> None:
        self._session = session
        self._height = height
        self._lock = threading.Lock()
        from uqmbd.viewer.page import viewer_page

        page, nonce = viewer_page(session.mechanism.name)
        self._server = PageServer(page, nonce, self._act, embedded=True)
        for answer in session.opening():
            self._server.send(answer)

    @property
    def address(self) -> str:
        """Address of the page."""
        return self._server.address

    def open(self) -> None:
        """Open the page in the browser."""
        webbrowser.open(self.address)

    def close(self) -> None:
        """End the server of the page."""
        if not self._server.ended.is_set():
            self._server.close()

    def _act(self, request: Mapping[str, Any]) -> None:
        if request.get("do") == "end":
            threading.Thread(target=self.close, daemon=True).start()
            return
        with self._lock:
            answer: Answer = self._session.answer(request)
        self._server.send(answer)

    def _repr_html_(self) -> str:
        """Return a frame with the page."""
        return (
            f'<iframe src="{escape(self.address)}" title="Viewer of the mechanism" '
            f'style="width:100%;height:{self._height}px;border:1px solid #8884"></iframe>'
        )


def view_mechanism(mechanism: Mechanism, times: Any = None) -> MechanismView:
    """Return the view of a mechanism; `times` are output times of its motion, s, or None."""
    from uqmbd.propagation import Study
    from uqmbd.viewer.session import Session

    if not mechanism.bodies:
        raise StudyError(f"mechanism {mechanism.name!r} has no bodies to draw; add one with mechanism.body(...).")
    study = None if times is None else Study(mechanism.name, mechanism, times)
    return MechanismView(Session(mechanism, study))

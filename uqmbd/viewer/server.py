"""Server of the viewer's page on the loopback address.

Only a request with the random token in its path, and with the host name and origin of this server, gets an answer.
Messages to the page are server-sent events.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import queue
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from uqmbd.viewer.messages import Answer, as_json

__all__ = ["PageServer"]

LONGEST = 1_000_000
"""Largest request of the page, bytes."""

KEEP_ALIVE = 0.5
"""Interval of keep-alive messages on a connection without other messages, s."""

LEFT = 2.0
"""Time between the last closed page and the end of the viewer, s; reloading a page takes less time."""

REPLAYED = ("status", "scene", "findings")
"""Kinds of messages of which a new page receives the latest message."""


class PageServer:
    """Server of one page.

    `page` is the HTML, with the nonce of its scripts. `act` is called with each request of the page.
    `embedded` allows other pages, such as notebooks, to show the page in a frame.
    """

    def __init__(
        self, page: str, nonce: str, act: Callable[[Mapping[str, Any]], None], *, port: int = 0, embedded: bool = False
    ) -> None:
        self.token = secrets.token_urlsafe(24)
        self.ended = threading.Event()
        self._page = page.encode()
        self._act = act
        self._pages: list[queue.Queue[Answer]] = []
        self._latest: dict[str, Answer] = {}
        self._lock = threading.Lock()
        self._left: float | None = None  # time at which the last page was closed
        frames = "*" if embedded else "'none'"
        self._policy = (
            f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; "
            f"img-src blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors {frames}"
        )
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self.port}/{self.token}/"

    def send(self, message: Answer) -> None:
        """Send a message to all pages."""
        with self._lock:
            if message["kind"] in REPLAYED:
                self._latest[message["kind"]] = message
                if message["kind"] == "scene":
                    self._latest.pop("findings", None)
            for page in self._pages:
                page.put(message)

    def abandoned(self) -> bool:
        """Return whether the last page was closed more than `LEFT` seconds ago."""
        with self._lock:
            return not self._pages and self._left is not None and time.monotonic() - self._left > LEFT

    def close(self) -> None:
        """End the server."""
        self.send({"kind": "ended"})
        time.sleep(0.05)  # wait until the pages have read the last message
        self.ended.set()
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            server_version = "uqmbd"
            sys_version = ""
            timeout = 30

            def do_GET(self) -> None:
                place = server._place(self)
                if place == "":
                    self._answer(200, server._page, "text/html; charset=utf-8")
                elif place == "events":
                    server._stream(self)
                else:
                    self._answer(404)

            def do_POST(self) -> None:
                length = self.headers.get("Content-Length", "")
                json_type = self.headers.get("Content-Type", "").partition(";")[0] == "application/json"
                if server._place(self) != "ask" or not json_type or not length.isdecimal() or int(length) > LONGEST:
                    self.close_connection = True
                    self._answer(404)
                    return
                request: Any = None
                with contextlib.suppress(ValueError):
                    request = json.loads(self.rfile.read(int(length)))
                if not isinstance(request, dict):
                    self._answer(400)
                    return
                server._act(request)
                self._answer(204)

            def _answer(self, status: int, body: bytes = b"", kind: str = "text/plain") -> None:
                self.send_response(status)
                self.write_headers(kind)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                with contextlib.suppress(OSError):
                    self.wfile.write(body)

            def write_headers(self, kind: str) -> None:
                """Write headers that forbid caches and access from other origins."""
                for name, value in {
                    "Content-Type": kind,
                    "Content-Security-Policy": server._policy,
                    "Cache-Control": "no-store",
                    "X-Content-Type-Options": "nosniff",
                    "Referrer-Policy": "no-referrer",
                    "Cross-Origin-Resource-Policy": "same-origin",
                }.items():
                    self.send_header(name, value)

            def log_message(self, format: str, *args: Any) -> None:
                """Suppress the log of requests."""

        return Handler

    def _place(self, request: BaseHTTPRequestHandler) -> str | None:
        """Return the path after the token, or None for a request that the server rejects."""
        own = {f"{name}:{self.port}" for name in ("127.0.0.1", "localhost")}
        origin = request.headers.get("Origin")
        if request.headers.get("Host") not in own or (origin is not None and origin.removeprefix("http://") not in own):
            return None
        _, _, rest = request.path.partition("/")
        token, slash, place = rest.partition("/")
        if not slash or not hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode()):
            return None
        return place

    def _stream(self, request: Any) -> None:
        """Send messages until the page is closed or the server ends."""
        request.send_response(200)
        request.write_headers("text/event-stream")
        request.close_connection = True
        request.end_headers()
        mine: queue.Queue[Answer] = queue.Queue()
        with self._lock:
            for kind in REPLAYED:
                if kind in self._latest:
                    mine.put(self._latest[kind])
            self._pages.append(mine)
        try:
            while not self.ended.is_set():
                try:
                    text = f"data: {as_json(mine.get(timeout=KEEP_ALIVE))}\n\n"
                except queue.Empty:
                    text = ": alive\n\n"
                request.wfile.write(text.encode())
                request.wfile.flush()
        except OSError:
            pass  # the page was closed
        finally:
            with self._lock:
                self._pages.remove(mine)
                self._left = None if self._pages else time.monotonic()

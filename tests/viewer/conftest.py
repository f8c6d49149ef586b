"""A viewer of a study file, and its page in a browser."""

import time

import pytest

from uqmbd.viewer import FileViewer


class Watched:
    """A viewer of a file, and its page."""

    def __init__(self, browser, file, seconds=20.0):
        self.file = file
        self.begin = time.monotonic()
        self.viewer = FileViewer(file, seconds)
        self.page = browser.new_page(viewport={"width": 1200, "height": 800})
        self.wrong = []
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", lambda said: self.wrong.append(said.text))
        self.page.on(
            "request",
            lambda one: (
                self.wrong.append(one.url)
                if self.viewer.server.address not in one.url and not one.url.startswith("data:")
                else None
            ),
        )
        self.page.goto(self.viewer.server.address)

    def until(self, condition, seconds=60.0):
        """Wait for a condition of the page; return how long it took, s."""
        begin = time.monotonic()
        while not self.page.evaluate(condition):
            assert time.monotonic() - begin < seconds, (condition, self.page.inner_text("body"))
            time.sleep(0.02)
        return time.monotonic() - begin

    def until_changed(self, picture, seconds=60.0):
        """Wait until the drawing differs from a picture of it."""
        end = time.monotonic() + seconds
        while self.page.locator("#drawing").screenshot() == picture:
            assert time.monotonic() < end, "the drawing does not change"

    def text(self, name):
        return self.page.inner_text(f"#{name}")

    def settle(self):
        """Wait until the spare process is ready, so that a change is answered at once."""
        end = time.monotonic() + 120
        while not self.viewer.prepared:
            assert time.monotonic() < end
            time.sleep(0.05)

    def close(self):
        self.page.close()
        if not self.viewer.server.ended.is_set():
            self.viewer.close()
        # an ended server refuses the connection of the stream
        assert not [one for one in self.wrong if "ERR_CONNECTION" not in one and "net::ERR" not in one]


@pytest.fixture
def watch_file(browser):
    """Open viewers of files, and close them."""
    opened = []

    def make(file, **options):
        opened.append(Watched(browser, file, **options))
        return opened[-1]

    yield make
    for one in opened:
        one.close()


@pytest.fixture
def watch(watch_file, tmp_path):
    """Open a viewer of a text."""

    def make(text, **options):
        file = tmp_path / "watched_study.py"
        file.write_text(text)
        return watch_file(file, **options)

    return make

"""Scripts of the page run by Node, and pages driven in a browser."""

import contextlib
import json
import shutil
import subprocess

import pytest

from uqmbd.report.live import joined_modules


@pytest.fixture
def node(tmp_path):
    """Run modules of the page with further lines that read `given` and set `answer`; both are JSON."""
    command = shutil.which("node")
    if command is None:
        pytest.skip("node is not on this machine: what the page computes is not verified")

    def run(names, lines, given=None):
        script = tmp_path / "script.mjs"
        script.write_text(
            'import { readFileSync as _read } from "node:fs";\n'
            + joined_modules(*names)
            + "\nconst given = JSON.parse(_read(0, 'utf-8'));\nlet answer = null;\n"
            + lines
            + "\nconsole.log(JSON.stringify(answer));\n",
            encoding="utf-8",
        )
        done = subprocess.run(
            [command, str(script)], input=json.dumps(given), capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.fixture
def opened(browser):
    """Open pages with all parts unfolded, and check at the end that none had an error or asked for anything."""
    with contextlib.ExitStack() as closing:
        wrong = []

        def open_page(path, width=1200, height=900, *, unfolded=True, **context):
            made = browser.new_context(viewport={"width": width, "height": height}, **context)
            closing.callback(made.close)
            page = made.new_page()
            # Chromium remarks that reading pixels is slow: these tests do it, and so do drawings without a GPU
            remarks = ("willReadFrequently", "GPU stall due to ReadPixels", "software WebGL")
            page.on("console", lambda said: any(one in said.text for one in remarks) or wrong.append(said.text))
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.on(
                "request", lambda asked: asked.url.startswith(("file:", "data:", "blob:")) or wrong.append(asked.url)
            )
            page.goto(path.as_uri())
            if unfolded:
                page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
            return page

        yield open_page
        assert not wrong

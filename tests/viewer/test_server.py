"""The server of the viewer answers nobody but its own page."""

import http.client
import json
import queue
import socket
import subprocess
import sys
import time

import psutil
import pytest

import uqmbd
from uqmbd.viewer import view_study
from uqmbd.viewer.child import Child
from uqmbd.viewer.server import PageServer


@pytest.fixture
def server():
    asked = queue.Queue()
    made = PageServer("<p>page", "nonce", asked.put)
    made.asked = asked
    yield made
    if not made.ended.is_set():
        made.close()


def request(server, path, method="GET", body=None, host=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{server.port}")
    data = None if body is None else json.dumps(body).encode()
    for name, value in {**headers, **({} if data is None else {"Content-Length": str(len(data))})}.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders(data)
    answer = connection.getresponse()
    found = answer.status, answer.read(), dict(answer.headers)
    connection.close()
    return found


def test_the_page_has_a_policy_that_allows_its_own_scripts_only(server):
    status, text, headers = request(server, f"/{server.token}/")
    assert status == 200 and text == b"<p>page"
    policy = headers["Content-Security-Policy"]
    assert (
        "default-src 'none'" in policy and "script-src 'nonce-nonce'" in policy and "frame-ancestors 'none'" in policy
    )
    assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize(
    "wrong",
    [
        {"path": "/"},
        {"path": "/wrong-token/"},
        {"path": "/{token}"},
        {"path": "/{token}/../{token}/"},
        {"path": "/{token}/other"},
        {"host": "evil.example"},
        {"host": "127.0.0.1"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "https://127.0.0.1:{port}"},
    ],
)
@pytest.mark.parametrize("place", ["", "events", "ask"])
def test_other_origins_hosts_and_tokens_get_nothing(server, wrong, place):
    given = {key: value.format(token=server.token, port=server.port) for key, value in wrong.items()}
    path = given.pop("path", f"/{server.token}/")
    posted = {"method": "POST", "body": {"do": "end"}, "Content_Type": "application/json"} if place == "ask" else {}
    status, text, _ = request(server, path + place, **posted, **given)
    assert status == 404 and text == b""
    assert server.asked.empty()


@pytest.mark.thorough
def test_a_port_in_use_is_one_message_and_leaves_no_process(tmp_path):
    script = tmp_path / "any_study.py"
    script.write_text("")
    before = set(psutil.Process().children())
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(uqmbd.StudyError, match="choose another port"):
            view_study(script, port=taken.getsockname()[1], opened=False)
    assert set(psutil.Process().children()) <= before
    with pytest.raises(uqmbd.StudyError, match="expected a positive number of seconds"):
        view_study(script, seconds=0.0, opened=False)


def test_requests_are_json_of_the_page(server):
    path, json_type = f"/{server.token}/ask", {"Content_Type": "application/json"}
    own = {"Origin": f"http://127.0.0.1:{server.port}"}
    assert request(server, path, "POST", {"do": "pose"}, **json_type, **own)[0] == 204
    assert server.asked.get(timeout=1) == {"do": "pose"}
    assert request(server, path, "POST", {"do": "end"}, Content_Type="text/plain")[0] == 404
    assert request(server, path, "POST", ["end"], **json_type)[0] == 400
    assert request(server, path)[0] == 404
    assert server.asked.empty()


def test_a_new_page_gets_the_latest_messages_and_a_closed_one_ends_the_viewer(server):
    for k in (1, 2):
        server.send({"kind": "scene", "k": k})
        server.send({"kind": "findings", "k": k})
    server.send({"kind": "scene", "k": 3})
    assert not server.abandoned()
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.request("GET", f"/{server.token}/events")
    answer = connection.getresponse()
    assert answer.headers["Content-Type"] == "text/event-stream"
    # the findings belong to an earlier scene
    assert json.loads(answer.fp.readline().removeprefix(b"data: ")) == {"kind": "scene", "k": 3}
    answer.fp.readline()
    server.send({"kind": "pose", "value": float("nan")})
    assert json.loads(answer.fp.readline().removeprefix(b"data: ")) == {"kind": "pose", "value": None}
    answer.close()
    connection.close()
    for _ in range(200):
        if server.abandoned():
            return
        time.sleep(0.05)
    pytest.fail("the server does not notice that its page was closed")


@pytest.mark.thorough
def test_the_first_script_sees_no_arguments_of_the_viewer(tmp_path):
    """Scripts with a parser of arguments, in the process that does not prepare."""
    script = tmp_path / "parsed_study.py"
    script.write_text(
        "import argparse, uqmbd\n"
        "argparse.ArgumentParser().parse_args()\n"
        "mechanism = uqmbd.Mechanism('stone', uqmbd.Planar())\n"
        "mechanism.body('stone', mass=1, inertia=1)\n"
    )
    child = Child(prepared=False)
    try:
        kinds = [answer["kind"] for answer in child.ask({"do": "load", "file": str(script)}, 120.0)]
    finally:
        child.end()
    assert kinds == ["scene", "findings"]


@pytest.mark.thorough
def test_the_server_imports_no_numerical_package():
    """The imports of the process of the page would delay the process that draws."""
    text = """
import sys
import uqmbd.cli.app
import uqmbd.viewer
from uqmbd.viewer.page import viewer_page
viewer_page("study.py")
print(sorted({"numpy", "scipy", "sympy", "xarray"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

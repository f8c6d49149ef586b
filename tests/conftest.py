"""What tests share: vector outputs, the energy along a motion, comparison at a scale, projected mechanisms."""

from __future__ import annotations

import gc
import shutil
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest

import uqmbd
from uqmbd.cli import main
from uqmbd.dynamics import Ensemble, build, integrate

from .clock import CLOCK
from .mechanisms import oscillator, pendulum, rolling_wheel, sleigh, slider_crank, spatial_pendulum

MANY = 6
"""Cases of one thorough test above which `-m thorough` runs a part of them; the slow tests have them all."""

PART = 4
"""`-m thorough` runs one of so many of these cases."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark three of four cases of thorough tests with many cases as slow, except with ``thorough(every_case=True)``."""
    cases = {}
    for item in items:
        marker = item.get_closest_marker("thorough")
        if marker and not marker.kwargs.get("every_case") and not item.get_closest_marker("slow"):
            cases.setdefault((item.parent.nodeid, getattr(item, "originalname", item.name)), []).append(item)
    for same in cases.values():
        if len(same) > MANY:
            for k, item in enumerate(same):
                if k % PART:
                    item.add_marker(pytest.mark.slow)


def pytest_collection_finish():
    """Search for garbage seldom, and never among modules and tests: an eighth of the time went into it, measured."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def counted_clocks():
    """Let durations be counted: the clocks they are measured by go on whenever they are read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "perf_counter", CLOCK)
        patch.setattr(time, "process_time", CLOCK)
        yield


@pytest.fixture(scope="session")
def observe():
    """Record every entry of a vector (or scalar) of a mechanism under one name."""

    def record(mechanism, **quantities):
        for name, vector in quantities.items():
            entries = list(vector) if hasattr(vector, "__getitem__") else [vector]
            for k, entry in enumerate(entries):
                mechanism.output(f"{name}[{k}]", entry)

    return record


@pytest.fixture(scope="session")
def series():
    """Stack the entries that `observe` recorded: an array (time, entry)."""

    def stack(data, name):
        found = [v for v in data.data_vars if v.startswith(f"{name}[")]
        return np.stack([data[f"{name}[{k}]"].values for k in range(len(found))], axis=1)

    return stack


@pytest.fixture(scope="session")
def close():
    """Compare at a fraction of the quantity's own scale (its largest expected value unless it is given)."""

    def compare(actual, expected, relative=1e-4, scale=None, what=""):
        actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
        size = float(np.abs(expected).max()) if scale is None else scale
        np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * size, err_msg=what)

    return compare


@pytest.fixture(scope="session")
def same_rotation():
    """Compare quaternions, which are known up to their sign."""

    def compare(actual, expected, atol=1e-4):
        actual, expected = np.atleast_2d(actual), np.atleast_2d(expected)
        sign = np.sign(np.sum(actual * expected, axis=1, keepdims=True))
        np.testing.assert_allclose(actual * sign, expected, rtol=0, atol=atol)

    return compare


@pytest.fixture(scope="session")
def states_of():
    """Integrate at the means: the ensemble and its states (q, s, v), an array (1, time, state)."""

    def run(mechanism, times, rtol=1e-8):
        times = np.asarray(times, dtype=float)
        ensemble = Ensemble(build(mechanism, float(times[0])), mechanism.inputs.means[None, :])
        found = integrate(ensemble, times, rtol)
        assert not found.messages[0]
        return ensemble, found.states

    return run


@pytest.fixture(scope="session")
def energy(states_of):
    """Kinetic and potential energy along the motion at the means, J: two arrays (time,)."""

    def along(mechanism, times, rtol=1e-8):
        if not mechanism.outputs:
            mechanism.output("clock", uqmbd.t)
        ensemble, states = states_of(mechanism, times, rtol)
        return ensemble.energies(np.asarray(times, dtype=float), states)[0]

    return along


@pytest.fixture(scope="session")
def turn():
    """Quaternion of a rotation about an axis."""

    def quaternion(axis, angle):
        axis = np.asarray(axis, dtype=float)
        return (np.cos(angle / 2), *(np.sin(angle / 2) * axis / np.linalg.norm(axis)))

    return quaternion


@pytest.fixture(scope="session")
def matrix():
    """Rotation matrix of a quaternion, scalar first."""

    def rotation(q):
        a, b = q[0], np.asarray(q[1:], dtype=float)
        cross = np.array([[0, -b[2], b[1]], [b[2], 0, -b[0]], [-b[1], b[0], 0]])
        return np.eye(3) + 2 * a * cross + 2 * cross @ cross

    return rotation


@pytest.fixture(scope="session")
def mechanisms():
    """Makers of mechanisms with random inputs, by name."""
    return {
        "pendulum": pendulum,
        "slider_crank": slider_crank,
        "spatial_pendulum": spatial_pendulum,
        "sleigh": sleigh,
        "rolling_wheel": rolling_wheel,
        "oscillator": oscillator,
    }


@pytest.fixture(scope="session")
def project():
    """Project a mechanism: the projected ensemble of an order, with Gauss nodes."""

    def make(mechanism, order, nodes=None, index_set="total", **options):
        space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        terms = uqmbd.extend.index_set(space.dimension, order, index_set)
        rule = uqmbd.extend.gauss_tensor(space, nodes or order + 1)
        ensemble = Ensemble(build(mechanism, **options), space.to_inputs(rule.nodes))
        return uqmbd.extend.ProjectedEnsemble(ensemble, space.evaluate(rule.nodes, terms), rule.weights)

    return make


@pytest.fixture
def no_report(monkeypatch):
    """Let `uqmbd run` draw nothing, which takes longer than small studies."""
    monkeypatch.setattr("uqmbd.cli.run.run.write", lambda tree, path, **_: path)
    monkeypatch.setattr("uqmbd.report.with_motion", lambda tree, study: (tree, ""))


@pytest.fixture
def command(monkeypatch, capsys, no_report):
    """Run `uqmbd` in this process, without a report: its status, and what it says."""

    def run(*words):
        monkeypatch.setattr(sys, "path", list(sys.path))
        with pytest.raises(SystemExit) as left, warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            main([str(word) for word in words])
        said = capsys.readouterr()
        return subprocess.CompletedProcess(words, left.value.code, said.out, said.err)

    return run


@pytest.fixture(scope="session")
def browser():
    """Drive the Chromium of this machine."""
    command = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chromium-browser"))), None)
    if command is None:
        pytest.skip("no Chromium is on this machine: charts in a browser are not verified")
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install uqmbd[browser]"
    )
    with playwright.sync_playwright() as running:
        opened = running.chromium.launch(executable_path=command, args=["--no-sandbox"])
        yield opened
        opened.close()

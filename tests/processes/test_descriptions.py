"""Processes with different functions are different, in one session and in later runs."""

from __future__ import annotations

import functools
import pickle

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import PowerSpectralDensity, RandomProcess, davenport_coherence, kaimal, stationary_std
from uqmbd_springs import PointForce, SpringDamper

LEVEL = 1.0


def process(function, name="force", **options):
    density = PowerSpectralDensity(function, sided="one", per="Hz", band=(0.1, 2.0))
    return RandomProcess(name, psd=density, units="N", **options)


def oscillator(*sources):
    mechanism = uqmbd.Mechanism("oscillators", uqmbd.Line())
    for k, source in enumerate(sources):
        body = mechanism.body(f"body{k}", mass=1.0, position=1.0)
        mechanism.add(SpringDamper(f"spring{k}", mechanism.ground, body, 0, 0, 36.0, damping=2.4, free_length=1))
        mechanism.add(PointForce(f"push{k}", body, 0, 1.0 * source()))
    return mechanism


def with_default(a):
    return lambda x, a=a: a * np.ones_like(x)


def with_keyword(a):
    def found(x, *, a=a):
        return a * np.ones_like(x)

    return found


def with_closure(a):
    return lambda x: a * np.ones_like(x)


def with_array(a):
    values = np.ones(3000)
    values[1500] = a
    return lambda x: np.interp(x, np.linspace(0.0, 2.0, 3000), values)


def with_spline(a):
    spline = CubicSpline(np.linspace(0.0, 3.0, 2000), np.linspace(1.0, a, 2000))
    return lambda x: np.asarray(spline(x))


def with_function(a):
    def inner(x):
        return a * x

    return lambda x: inner(np.ones_like(x))


class Level:
    def __init__(self, a):
        self.a = a

    def __call__(self, x):
        return self.a * np.ones_like(x)


def with_arguments(a):
    return functools.partial(Level.__call__, Level(a))


MAKERS = [with_default, with_keyword, with_closure, with_array, with_spline, with_function, Level, with_arguments]


@pytest.mark.parametrize("make", MAKERS)
def test_processes_differ_by_the_content_of_their_functions(make):
    one, same, other = (repr(process(make(a))) for a in (1.0, 1.0, 9.0))
    assert one == same != other
    found = [repr(RandomProcess("x", psd=kaimal(1, 2, 3), coherence=make(a))) for a in (1.0, 9.0)]
    assert found[0] != found[1]


def test_processes_differ_by_globals(monkeypatch):
    def level(x):
        return LEVEL * np.ones_like(x)

    before = process(level)
    text = repr(before)
    monkeypatch.setitem(globals(), "LEVEL", 9.0)
    assert repr(process(level)) != text == repr(before)


def test_copies_are_equal():
    one = process(Level(1.0))
    assert repr(pickle.loads(pickle.dumps(one))) == repr(one)


def test_functions_of_files_equal_only_themselves():
    def table():
        return lambda x: np.ones_like(x) if x is not None else np.loadtxt("table.txt")

    one, other = table(), table()
    assert repr(process(one)) == repr(process(one)) != repr(process(other))


def test_an_interrupted_run_with_another_spectrum_begins_again(tmp_path):
    def deviation(a):
        mechanism = oscillator(process(with_default(a)))
        mechanism.output("position", mechanism.bodies["body0"].position[0])
        study = uqmbd.Study("s", mechanism, [0.0, 3.0], [MonteCarlo(samples=8, seed=1)])
        return study.run(folder=tmp_path, resume=True)["monte-carlo/statistics"]["std"].values[0, -1]

    first = deviation(1.0)
    with pytest.warns(uqmbd.StudyWarning, match="belong to another study"):
        assert abs(deviation(9.0) / first - 3) < 1e-3


def test_points_of_a_field_have_one_spectrum():
    fields = [
        RandomProcess("wind", psd=kaimal(s, 340, 12), coherence=davenport_coherence(10, 12), cutoff=c)
        for s, c in ((1.5, 2.0), (4.5, 2.0), (1.5, 1.0))
    ]
    for other, options in ((fields[1], "psd"), (fields[2], "cutoff")):
        message = f"'wind at 0, 20' and 'wind at 0, 30' differ in {options};.*different names"
        sources = fields[0].at(0, 20), other.at(0, 30)
        with pytest.raises(uqmbd.StudyError, match=message):
            fields[0].sample_paths(sources, np.array([0.3]), 0.0, 1.0)
        mechanism = oscillator(*sources)
        both = mechanism.bodies["body0"].position[0] + mechanism.bodies["body1"].position[0]
        mechanism.output("deviation", stationary_std(both))
        with pytest.raises(uqmbd.StudyError, match=message):
            uqmbd.simulate(mechanism, [0.0, 1.0])

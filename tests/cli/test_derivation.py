"""Derivations that take a while are shown by commands, those of most mechanisms are not."""

from __future__ import annotations

import logging

import uqmbd
from uqmbd.cli.terminal import shown_derivation
from uqmbd.dynamics import kinematic_model
from uqmbd.logs import derivation, logged
from uqmbd_joints import Revolute


class Recorder:
    """Records messages."""

    def __init__(self):
        self.told = []

    def start(self, label, total):
        self.told.append(("start", label, total))

    def advance(self, label, count=1):
        self.told.append(("advance", label, count))

    def finish(self, label):
        self.told.append(("finish", label))

    def stage(self, text):
        self.told.append(("stage", text))

    def close(self):
        self.told.append(("close",))


def clock(step):
    """A clock that moves by so much at each look."""
    now = [0.0]

    def look():
        now[0] += step
        return now[0]

    return look


def chain(count):
    """Bodies that hang on each other."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Planar(gravity=(0, -9.81)))
    last = mechanism.ground
    for k in range(count):
        body = mechanism.body(f"b{k}", mass=1, inertia=0.1, position=(k, 0))
        mechanism.add(Revolute(f"j{k}", last, body, (0 if k == 0 else 1, 0), (0, 0)))
        last = body
    return mechanism


def test_a_derivation_that_takes_a_while_is_shown_with_its_parts():
    recorder = Recorder()
    with shown_derivation(recorder, clock(1.0)):
        kinematic_model(chain(4))
    labels = {}
    for kind, label, *rest in recorder.told:
        if kind == "start":
            labels[label] = [rest[0], 0]
        elif kind == "advance":
            labels[label][1] += rest[0]
    assert labels["deriving components"] == [8, 8]
    assert ("finish", "deriving components") in recorder.told
    told = [x[1] for x in recorder.told if x[0] == "stage"]
    assert told == [f"compiling equations ({x})" for x in ("position", "velocity", "initial", "acceleration")]


def test_a_quick_derivation_says_nothing():
    recorder = Recorder()
    with shown_derivation(recorder, clock(0.001)):
        kinematic_model(chain(4))
    assert recorder.told == []


def test_the_logger_is_afterwards_as_before_and_a_program_that_listens_is_left_alone(caplog):
    before = derivation.level, derivation.propagate, list(derivation.handlers)
    recorder = Recorder()
    with shown_derivation(recorder, clock(1.0)):
        pass
    assert (derivation.level, derivation.propagate, list(derivation.handlers)) == before
    with caplog.at_level(logging.DEBUG, "uqmbd.derivation"), shown_derivation(recorder, clock(1.0)):
        assert list(logged("counting", "ab")) == ["a", "b"]
    assert [x.getMessage() for x in caplog.records] == ["counting: 1 of 2", "counting: 2 of 2"] and not recorder.told


def test_work_that_ends_by_an_error_ends_its_bar():
    recorder = Recorder()
    try:
        with shown_derivation(recorder, clock(1.0)):
            for k in logged("counting", range(9)):
                if k == 5:
                    raise ValueError("stop")
    except ValueError:
        pass
    assert recorder.told[0] == ("start", "counting", 9) and recorder.told[-1] == ("finish", "counting")

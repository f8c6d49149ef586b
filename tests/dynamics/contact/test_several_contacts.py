"""Decisions of the driver about several contacts, compared with those in Python and with the laws themselves.

The laws: an impact has impulses in the friction cones that give the jump of the velocities, adds no energy, and leaves
no contact approaching; a contact that alone is hit rebounds by Newton's law, or not at all. Afterwards the forces of
closed contacts press, friction suffices where they stick and opposes the sliding elsewhere, and open contacts open.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import chaospy
import numpy as np
import pytest
import scipy.optimize
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.compiled import ExplicitStatus, Touching
from uqmbd.dynamics import Ensemble, build
from uqmbd.dynamics.contact import event_driven
from uqmbd.dynamics.contact.decisions import Decisions
from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute

from .python_decisions import Waiting, compare

G, END, COUNT = 9.81, 0.4, 24
LEVER = 0.05  # m/s of a contact per rad/s or m/s of a body, at least
MODELS = {}


def number(name, low, high):
    return uqmbd.RandomVariable(name, chaospy.Uniform(low, high))


def body_on_planes(kind):
    """A body with feet above planes: two or three feet on one plane, two on two slopes, and two bodies with a joint."""
    mechanism = uqmbd.Mechanism(kind, uqmbd.Planar(gravity=(0, -G)))
    tilt, lean = number("tilt", -0.3, 0.3), number("lean", -0.5, 0.5)
    place = {"position": (0, 0.1 + number("height", 0.1, 0.15)), "angle": number("angle", -0.2, 0.2)}
    motion = {"velocity": (number("vx", -1, 1), number("vy", -0.5, 0)), "angular_velocity": number("spin", -3, 3)}
    body = mechanism.body(
        "body", mass=number("mass", 0.5, 2), inertia=number("inertia", 0.005, 0.05), **place, **motion
    )
    feet, planes = {
        "two": ((-0.1, 0.12), (tilt, tilt)),
        "three": ((-0.1, 0.02, 0.12), (tilt, tilt, tilt)),
        "slopes": ((-0.1, 0.1), (lean, tilt)),
        "hinge": ((-0.1, 0.1), (tilt, tilt)),
    }[kind]
    bodies = [body] * len(feet)
    if kind == "hinge":
        bodies[1] = mechanism.body("arm", mass=1, inertia=0.01, **place, **motion)
        mechanism.add(Revolute("hinge", body, bodies[1], (0, 0), (0, 0)))
    for k, (x, slope) in enumerate(zip(feet, planes, strict=True)):
        law = {"restitution": number(f"e{k}", 0, 0.8), "friction": number(f"mu{k}", 0, 0.8)}
        mechanism.add(PlaneImpact(f"foot{k}", mechanism.ground, bodies[k], (0, 0), (x, -0.1), (slope, 1), **law))
    return mechanism


@dataclass
class Happened:
    """Events of a realisation: times, states before and after, modes and headings after them, and speeds that are none."""

    times: list = field(default_factory=list)
    before: list = field(default_factory=list)
    after: list = field(default_factory=list)
    lasted: list = field(default_factory=list)
    hits: list = field(default_factory=list)
    modes: list = field(default_factory=list)
    headings: list = field(default_factory=list)
    still: list = field(default_factory=list)

    def alone(self):
        """Places of the events without another one at the same instant."""
        t = np.array([-np.inf, *self.times, np.inf])
        return [k for k in range(len(self.times)) if min(t[k + 1] - t[k], t[k + 2] - t[k + 1]) > 1e-9]


def followed(ensemble, waiting):
    """Integrate; return the motion and the events of each realisation, of the driver or (`waiting`) in Python."""
    found, decided, old = [Happened() for _ in range(len(ensemble))], [0], Decisions.after

    def after(self, member, guard, time, z, contacts):
        decided[0] += 1
        modes = self.encounters.mode[member].copy()
        new = old(self, member, guard, time, z, contacts)
        if waiting:
            keep(member, time, z, new)
            found[member].lasted.append(modes)
            found[member].hits.append(modes[guard // 2] == Touching.OPEN)
        return new

    def keep(member, time, before, after):
        one = found[member]
        one.times.append(time)
        one.before.append(None if before is None else before.copy())
        one.after.append(after.copy())
        one.modes.append(motion.encounters.mode[member].copy())
        one.headings.append(motion.encounters.heading[member].copy())
        one.still.append(motion.decisions.slow(member))

    def begun():
        for m in np.flatnonzero(motion.run.status == ExplicitStatus.STEPPED).tolist():
            if motion.run.now[m] > 0:
                keep(m, float(motion.run.now[m]), None, motion.run.z[m])

    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        patch.setattr(Decisions, "after", after)
        if waiting:
            patch.setattr(event_driven, "Encounters", Waiting)
        motion = event_driven.EventDrivenMotion(ensemble, np.array([0, END]), 1e-10, ContactEvaluator(ensemble.model))
        if not waiting:
            motion.restarted, motion.encounters.reports = begun, True
        motion.follow()
    assert not any(motion.messages), [x for x in motion.messages if x]
    return motion, found, decided[0]


def laws_of_impact(here, contacts, before, after, slow, hits):
    """Test the jump of the velocities at an event with closed contacts `here`, an impact if it `hits`.

    Speeds up to `slow` may be removed.
    """
    n, jump = contacts.coordinates, (after - before)[-contacts.coordinates :]
    rays, owners = [], []
    for k in here:
        for side in (-1, 1) if contacts.has_friction(k) else (0,):
            ray = np.zeros(contacts.first[-1])
            ray[contacts.normal(k)] = 1
            ray[contacts.tangents(k)] = side * contacts.law[0, k, 1]
            rays.append(ray)
            owners.append(k)
    spread = np.array(rays).T
    answer = contacts.answer[0, :n] @ spread
    size = np.abs(answer).max()
    share, rest = scipy.optimize.nnls(answer / size, jump)
    assert rest <= slow / LEVER, "the impulses are in the friction cones"
    impulse, s0 = spread @ (share / size), contacts.speed[0]
    s1 = s0 + contacts.delassus[0] @ impulse
    # removed speeds change the energy by their product with the momentum
    lost = slow * (np.abs(impulse).sum() + 10 * np.abs(before[-n:]).max())
    assert impulse @ (s0 + s1) / 2 <= lost, "no energy is added"
    assert not hits or all(s1[contacts.normal(k)] >= -slow for k in here), "no contact approaches"
    hit = {k for k, x in zip(owners, share, strict=True) if x * np.diag(contacts.delassus[0]).max() > slow * size}
    if len(hit) == 1 and s0[contacts.normal(min(hit))] < -10 * slow:
        j, e = contacts.normal(min(hit)), contacts.law[0, min(hit), 0]
        assert min(abs(s1[j] + e * s0[j]), abs(s1[j])) <= slow, "Newton's law, or no rebound"


def laws_of_forces(here, contacts, mode, heading, slow):
    """Test the modes of one state: forces from the equations of motion, and the accelerations that they cause.

    Speeds up to `slow` may have been removed, so that those of a few percent may have been none.
    """
    natural = contacts.bias[0] + contacts.slope[0] @ contacts.free[0, : contacts.coordinates]
    lasting = [k for k in here if mode[k] != Touching.OPEN]
    columns, rows = [], []
    for k in lasting:
        column = np.zeros(len(natural))
        column[contacts.normal(k)] = 1
        rows.append(contacts.normal(k))
        columns.append(column)
        if mode[k] == Touching.SLIP:
            column[contacts.tangents(k)] = -contacts.law[0, k, 1] * heading[contacts.tangents(k)]
        elif mode[k] == Touching.STICK:
            rows += contacts.tangents(k)
            columns.append(np.zeros(len(natural)))
            columns[-1][contacts.tangents(k)] = 1
    force = np.zeros(len(natural))
    if columns:
        spread = np.array(columns).T
        force = spread @ np.linalg.lstsq((contacts.delassus[0] @ spread)[rows], -natural[rows], rcond=1e-10)[0]
    rate, small = natural + contacts.delassus[0] @ force, 1e-6 * np.abs(natural).max()
    assert np.abs(rate[rows]).max(initial=0) <= small, "lasting contacts last"
    sure = len(columns) == np.linalg.matrix_rank(contacts.delassus[0][np.ix_(rows, rows)], 1e-9) if columns else True
    for k in here:
        normal, tangents = contacts.normal(k), contacts.tangents(k)
        along, size = contacts.speed[0, tangents], 1e-6 * np.abs(force).max()
        if mode[k] == Touching.OPEN:
            assert contacts.speed[0, normal] > 0.03 * slow or rate[normal] >= -small, "an open contact opens"
            continue
        assert not sure or force[normal] >= -size, "contacts press"
        if mode[k] == Touching.STICK:
            assert np.linalg.norm(along) <= 2 * slow
            most = contacts.law[0, k, 1] * force[normal]
            assert not sure or np.linalg.norm(force[tangents]) <= most + size, "friction suffices"
        elif mode[k] == Touching.SLIP:
            forward = along @ heading[tangents]
            assert forward >= -slow
            assert forward > 0.03 * slow or rate[tangents] @ heading[tangents] >= -small, (
                "a slide begins along its heading"
            )


def compare_with_laws(kind, seed):
    """Compare events of random bodies; return the numbers of compared events, and of those left to Python."""
    if kind not in MODELS:
        mechanism = body_on_planes(kind)
        MODELS[kind] = build(mechanism), mechanism.inputs
    model, inputs = MODELS[kind]
    unit = np.random.default_rng(seed).uniform(size=(COUNT, len(inputs)))
    ensemble = Ensemble(model, inputs.from_uniform(unit))
    driver, ours, left = followed(ensemble, waiting=False)
    python, theirs, _ = followed(ensemble, waiting=True)
    compared, differ, evaluator = 0, 0, driver.evaluator
    assert np.abs(driver.run.z - python.run.z).max() < 1e-5
    for m, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        for k in other.alone():
            where = [j for j in one.alone() if abs(one.times[j] - other.times[k]) < 1e-9]
            if len(where) != 1:  # the driver reports no rebounds of single contacts
                continue
            (j,), before, time = where, other.before[k], np.array([other.times[k]])
            assert np.array_equal(one.modes[j], other.modes[k])
            np.testing.assert_allclose(one.headings[j], other.headings[k], rtol=0, atol=1e-9)
            allowed = 1e-9 * max(1, np.abs(before).max()) + 100 * abs(one.times[j] - time[0])
            if (off := np.abs(one.after[j] - other.after[k]).max()) > allowed:
                # a sliding speed that is zero, with either sign of its rounding error, is projected differently
                assert off <= one.still[j]
                differ += 1
                break
            first, last = (evaluator(time, z[None], ensemble.block[m : m + 1]) for z in (before, one.after[j]))
            gaps, closed = first.guard[0], 1.001e-9 * driver.length[m]
            here = [c for c, x in enumerate(gaps) if x <= closed or other.lasted[k][c] or one.modes[j][c]]
            laws_of_impact(here, first, before, one.after[j], 3 * one.still[j], other.hits[k])
            at_rest = [
                c
                for c in here
                if one.modes[j][c] != Touching.OPEN or abs(last.speed[0, last.normal(c)]) <= one.still[j]
            ]
            laws_of_forces(at_rest, last, one.modes[j], one.headings[j], 3 * one.still[j])
            compared += 1
    assert differ <= COUNT / 8
    return compared, left


KINDS = ("two", "three", "slopes", "hinge")


@pytest.mark.parametrize("kind", [KINDS[0], *(pytest.param(x, marks=pytest.mark.thorough) for x in KINDS[1:])])
def test_events_of_random_bodies_satisfy_the_laws(kind):
    compared, left = compare_with_laws(kind, 1)
    assert compared > COUNT / 2
    assert left < compared / 5


@pytest.mark.thorough
@settings(max_examples=12, deadline=None, phases=[Phase.generate])
@given(st.sampled_from(KINDS), st.integers(0, 2**32 - 1))
def test_events_of_many_random_bodies_satisfy_the_laws(kind, seed):
    """Each example has some 400 events."""
    compare_with_laws(kind, seed)


@pytest.mark.parametrize(
    "name", ["rod", *(pytest.param(x, marks=pytest.mark.thorough) for x in ("corner", "ceiling", "groove"))]
)
def test_drops_are_those_of_decisions_in_python(falling, name):
    mechanism = falling(name)
    values = mechanism.inputs.from_uniform(np.random.default_rng(5).uniform(size=(6, len(mechanism.inputs))))
    compare(Ensemble(build(mechanism), values), np.linspace(0, 1, 21), 1e-5)

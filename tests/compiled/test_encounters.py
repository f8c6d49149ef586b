"""Events and contacts that last in the driver, on points of mass one that are pulled down by 10 and up by p t."""

import numpy as np
import symengine as se

from uqmbd.compiled import (
    ContactPrograms,
    Dynamics,
    Encounters,
    ExplicitOptions,
    ExplicitStatus,
    IntegrationState,
    ProgramWriter,
    Touching,
    compile_kernel,
)

Q, V, T, ZERO, P = se.symbols("q v t zero p")
END = 3.0


def programs():
    """One coordinate, a contact where it is zero, and a mark where its velocity falls through zero."""
    writer, state = ProgramWriter(5), np.arange(5)[None]
    (force,) = writer.call(compile_kernel([Q, V, T, ZERO, P], [P * T - 10]), state).ravel()
    motion = writer.part(0, 1)
    gap, speed, one = writer.call(compile_kernel([Q, V, T, ZERO, P], [Q, V, 1 + 0 * Q]), state).ravel()
    rows, nothing = writer.size, np.array([3])
    contacts = ContactPrograms(
        first=np.array([0, 1, 1]),
        guards=writer.part(1),
        guard=np.array([gap, speed]),
        contact=writer.part(),
        gap=np.array([gap, speed]),
        law=np.full((2, 2), 3),
        speed=np.array([speed]),
        bias=nothing,
        slope=np.array([[one]]),
        size=1,
        rows=np.array([0]),
        columns=np.array([0]),
        values=np.array([one]),
        right=np.array([force]),
    )
    return Dynamics(1, 1, 2, 1, motion, np.array([1, force]), None, rows, 2), contacts


def started(z, p, times, **changes):
    dynamics, contacts = programs()
    encounters = Encounters(contacts, len(z))
    encounters.length[:], encounters.slow[:] = 1.0, 1e-9
    for name, value in changes.items():
        getattr(encounters, name)[:] = value
    given = dict(far=1e-3, surplus=4.0, stiff=6.1, patience=10**9, refusals=3, attempts=1000, guarded=False)
    intervals = [[(END, END / 20, False)]]
    method = ExplicitOptions(rtol=1e-10, **given)
    run = IntegrationState(
        dynamics, method, z, np.array(p)[:, None], times, intervals, np.full(len(z), 1e-10), contacts, encounters
    )
    run.advance()
    return run, encounters


def test_falls_are_stopped_on_the_ground_and_apexes_noted():
    heights, speeds = np.linspace(0.1, 3, 11), np.linspace(-1, 4, 11)
    times = np.linspace(0, END, 31)
    resting = np.zeros((11, 4), dtype=np.int64)
    resting[:, 2] = speeds <= 0  # what does not rise at the start has no apex
    run, encounters = started(np.stack([heights, speeds], axis=1), np.zeros(11), times, resting=resting)
    assert (run.status == ExplicitStatus.EVENT).all() and (encounters.happened == 0).all()
    landing = (speeds + np.sqrt(speeds**2 + 20 * heights)) / 10
    np.testing.assert_allclose(run.now, landing, rtol=1e-13)
    np.testing.assert_allclose(run.z[:, 1], speeds - 10 * landing, rtol=1e-12)
    thrown = speeds > 0
    np.testing.assert_array_equal(encounters.noted, thrown)
    np.testing.assert_allclose(encounters.mark_times[thrown, 0], speeds[thrown] / 10, atol=1e-13)
    assert (encounters.mark[thrown, 0] == 1).all()
    # nothing is written beyond the event
    np.testing.assert_array_equal(run.column, np.searchsorted(times, landing))


def test_contacts_last_until_their_force_vanishes():
    p = np.linspace(4, 20, 9)
    mode = np.tile([Touching.SMOOTH, Touching.OPEN], (9, 1))
    run, encounters = started(np.zeros((9, 2)), p, np.array([0, 0.2, END]), mode=mode)
    assert (run.status == ExplicitStatus.EVENT).all() and (encounters.happened == 0).all()
    np.testing.assert_allclose(run.now, 10 / p, rtol=1e-12)
    assert np.abs(run.z).max() < 1e-14
    assert np.abs(run.result[:, 1]).max() < 1e-14


def test_a_guard_that_rests_has_to_rise():
    """A throw from the ground, whose gap is zero at the beginning, lands after 2 v / g, also within a first long step."""
    speeds = np.geomspace(1e-4, 5, 16)
    resting, rise = np.zeros((16, 4), dtype=np.int64), np.zeros((16, 4))
    resting[:, 0], rise[:, 0] = 1, speeds
    z = np.stack([np.zeros(16), speeds], axis=1)
    run, encounters = started(z, np.zeros(16), np.array([0, END]), resting=resting, rise=rise)
    assert (run.status == ExplicitStatus.EVENT).all()
    np.testing.assert_allclose(run.now, speeds / 5, rtol=1e-9)
    np.testing.assert_allclose(run.z[:, 1], -speeds, rtol=1e-9)

"""Newton's law of restitution with Coulomb friction, against all its solutions, found by enumeration.

The enumeration knows nothing of the solver: it writes down the velocities after an impact and the impulses as unknowns
of one linear system per combination of modes (stick, slip to either side, no contact), and keeps what satisfies the laws.
"""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
import scipy.optimize
import sympy

import uqmbd
from uqmbd.dynamics.contact.coulomb import Collision, Touch, solutions
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.impacts import impact
from uqmbd.dynamics.contact.persistent import contact_forces, persistent_contacts
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo

ZERO = (0, 0)


# -- the oracle ----------------------------------------------------------------------------------------------------
def enumerated(mass, across, along, velocity, e, mu, sliding=None):
    """All velocities after a collision of contacts in the plane: each a pair of velocities and energy gained.

    Parameters: mass (n, n); rows `across` and `along` (contact, n), which give the normal and the sliding speeds;
    `sliding` (contact), where the direction of friction is against a known sliding: +1, -1, or 0 where it is not known.
    The same for accelerations in the place of velocities.
    """
    n, count = len(velocity), len(e)
    sliding = np.zeros(count) if sliding is None else sliding
    found = []
    scale = np.abs(np.vstack([across, along]) @ velocity).max()
    for modes in itertools.product(*[("open", x) if x else ("open", "stick", +1, -1) for x in sliding]):
        # unknowns: velocities, normal impulses, tangential impulses
        system, right = np.zeros((n + 2 * count, n + 2 * count)), np.zeros(n + 2 * count)
        system[:n, :n], right[:n] = mass, mass @ velocity
        for k, mode in enumerate(modes):
            normal, tangential = n + k, n + count + k
            system[:n, normal], system[:n, tangential] = -across[k], -along[k]
            if mode == "open":
                system[normal, normal] = system[tangential, tangential] = 1
                continue
            system[normal, :n], right[normal] = across[k], -e[k] * (across[k] @ velocity)
            if mode == "stick":
                system[tangential, :n] = along[k]
            else:
                system[tangential, [tangential, normal]] = 1, mode * mu[k]
        unknown = np.linalg.lstsq(system, right, rcond=1e-12)[0]
        if np.abs(system @ unknown - right).max() > 1e-9 * scale:
            continue
        after, push, rub = unknown[:n], unknown[n : n + count], unknown[n + count :]
        size = max(np.abs(unknown[n:]).max(initial=0), np.abs(mass @ velocity).max())
        small, slow = 1e-9 * size, 1e-9 * scale
        good = (push >= -small).all() and (np.abs(rub) <= mu * push + small).all()
        for k, mode in enumerate(modes):
            good &= bool(across[k] @ after >= -e[k] * (across[k] @ velocity) - slow)
            if mode in (+1, -1) and not sliding[k]:
                good &= bool(mode * (along[k] @ after) >= -slow)
        if good:
            found.append((after, 0.5 * (after @ mass @ after - velocity @ mass @ velocity)))
    return found


def outcomes(mass, across, along, velocity, e, mu, depth=6):
    """All velocities after an impact, in which contacts that come to approach each other collide next.

    Restitution is dropped where every solution with it feeds in energy, or none exists.  None: more than `depth`.
    """
    energy = 0.5 * velocity @ mass @ velocity
    hit = across @ velocity < -1e-12
    if not hit.any():
        return [velocity]
    if depth == 0:
        return None
    for restitution in (e[hit], 0 * e[hit]):
        solved = enumerated(mass, across[hit], along[hit], velocity, restitution, mu[hit])
        kept = [after for after, gained in solved if gained <= 1e-11 * energy]
        if kept:
            further = [outcomes(mass, across, along, after, e, mu, depth - 1) for after in kept]
            return None if any(x is None for x in further) else [x for each in further for x in each]
    raise AssertionError("the law without restitution always has a solution")


# -- what is tested ------------------------------------------------------------------------------------------------
def contacts_of(mass, across, along, velocity, e, mu):
    """The same for the solver; along (contact, tangent, n)."""
    count, tangents, n = along.shape
    rows = np.concatenate([across[:, None], along], axis=1).reshape(-1, n)
    answer = np.linalg.solve(mass, rows.T)
    first = tuple(range(0, (1 + tangents) * count + 1, 1 + tangents))
    law = np.column_stack([e, mu])[None]
    none = np.zeros((1, len(rows)))
    return ContactQuantities(
        np.zeros((1, count)), first, law, (rows @ velocity)[None], none, rows[None], np.zeros((1, n)), answer[None],
        (rows @ answer)[None],
    )  # fmt: skip


def solved(mass, across, along, velocity, e, mu):
    contacts = contacts_of(mass, across, along, velocity, e, mu)
    found = impact(contacts, list(range(len(e))), 1e-12)
    assert found is not None
    return velocity + found[0]


def rod(rng, places, normals):
    """Inertia, and rows of the contacts of a rod of half length one at an angle, at places along it."""
    m, angle = rng.uniform(0.2, 5), rng.uniform(-np.pi, np.pi)
    mass = np.diag([m, m, m * rng.uniform(0.01, 1)])
    arms = np.outer(places, [np.cos(angle), np.sin(angle)])
    tangents = np.column_stack([normals[:, 1], -normals[:, 0]])
    turn = np.column_stack([-arms[:, 1], arms[:, 0]])
    across = np.column_stack([normals, (normals * turn).sum(axis=1)])
    along = np.column_stack([tangents, (tangents * turn).sum(axis=1)])
    return mass, across, along


def random_case(rng, count):
    """A rod that one plane, or two, stop, at random; in a quarter of those with two it falls flat on one."""
    flat = count == 2 and rng.random() < 0.25
    directions = rng.uniform(-np.pi, np.pi, count)
    normals = np.column_stack([np.cos(directions), np.sin(directions)])
    places = rng.uniform(-1, 1, count)
    mass, across, along = rod(rng, places, normals)
    if flat:
        across = np.column_stack([np.zeros(2), np.ones(2), places])
        along = np.column_stack([np.ones(2), np.zeros(2), np.zeros(2)])
    e = rng.choice([0.0, 1.0, rng.random()], p=[0.1, 0.2, 0.7]) * np.ones(count)
    e = np.where(rng.random(count) < 0.5, e, rng.random(count))
    mu = np.where(rng.random(count) < 0.1, 0.0, rng.choice([0.3, 1.0, 5.0]) * rng.random(count))
    velocity = rng.normal(size=3) * [1, 1, rng.choice([0.0, 1.0, 10.0])]
    return mass, across, along, velocity, e, mu


def compare(count, samples, seed):
    rng = np.random.default_rng(seed)
    compared = 0
    while compared < samples:
        mass, across, along, velocity, e, mu = random_case(rng, count)
        if not (across @ velocity < -1e-6).any():
            continue
        possible = outcomes(mass, across, along, velocity, e, mu)
        if possible is None:
            continue
        after = solved(mass, across, along[:, None], velocity, e, mu)
        scale = np.sqrt(np.diag(mass)) * np.sqrt(velocity @ mass @ velocity) / np.diag(mass)
        misses = [np.abs((after - x) / scale).max() for x in possible]
        assert min(misses) < 1e-7, f"{after} is none of {possible}"
        compared += 1


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, 2])
def test_an_impact_is_one_of_the_solutions_of_the_law(count):
    compare(count, 800 if count == 1 else 300, seed=count)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_an_impact_is_one_of_the_solutions_of_the_law_for_many_rods(count):
    compare(count, 20_000, seed=10 + count)


def check_rest(count, samples, seed):
    rng, solvable, wedged = np.random.default_rng(seed), 0, 0
    for _ in range(samples):
        mass, across, along, applied, _, mu = random_case(rng, count)
        free = np.linalg.solve(mass, applied)
        sliding = rng.choice([0.0, 0.0, 1.0, -1.0], size=count)
        rows = np.concatenate([across[:, None], along[:, None]], axis=1).reshape(-1, 3)
        speed = np.column_stack([np.zeros(count), sliding * rng.uniform(0.1, 1, count)]).reshape(1, -1)
        found = persistent_contacts(
            ContactQuantities(
                np.zeros((1, count)), tuple(range(0, 2 * count + 1, 2)), np.column_stack([0 * mu, mu])[None], speed,
                np.zeros_like(speed), rows[None], free[None], np.linalg.solve(mass, rows.T)[None],
                (rows @ np.linalg.solve(mass, rows.T))[None],
            ),
            list(range(count)), 1e-6,
        )  # fmt: skip
        known = np.where(mu > 0, sliding, 0.0)
        possible = [after for after, _ in enumerated(mass, across, along, free, np.zeros(count), mu, known)]
        if found is None:
            assert not possible
            assert sliding.any(), "at rest the laws always have a solution"
            wedged += 1
            continue
        scale = np.abs(free).max()
        assert min(np.abs(found[1].motion[0] - x).max() for x in possible) < 1e-6 * scale
        solvable += 1
    assert solvable > 0.8 * samples
    return wedged


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, 2])
def test_contacts_at_rest_follow_one_of_the_solutions_of_the_law(count):
    """Where a contact at rest cannot stick it slips: it is not let go, and its friction is not left out."""
    check_rest(count, 500, seed=20 + count)


@pytest.mark.slow
def test_contacts_at_rest_follow_one_of_the_solutions_of_the_law_for_many_rods():
    assert sum(check_rest(count, 10_000, seed=30 + count) for count in (1, 2)) > 0


def tip(speed, restitution, friction):
    """Velocities right after a uniform rod of 1 m, 1 kg at 45 degrees has hit the floor with its lower end at 1 m/s."""
    mechanism, height = uqmbd.Mechanism("rod", uqmbd.Planar()), 0.5 * np.sin(np.pi / 4) + 0.1
    motion = {"velocity": (speed, -1), "angular_velocity": 0}
    body = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0, height), angle=np.pi / 4, **motion)
    law = {"restitution": restitution, "friction": friction}
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, ZERO, (-0.5, 0), (0, 1), **law))
    for name, x in (("vx", body.velocity[0]), ("vy", body.velocity[1]), ("w", body.angular_velocity)):
        mechanism.output(name, x)
    data = uqmbd.simulate(mechanism, [0, 0.11]).isel(time=1)
    return np.array([data.vx, data.vy, data.w])


def after_impulses(speed, normal, tangential):
    """The same in closed form; the arms of both impulses are 1 / sqrt(8) m."""
    return [speed + tangential, -1 + normal, 12 / np.sqrt(8) * (tangential - normal)]


def test_friction_of_an_impact_that_sticks_in_no_way_is_that_of_sliding():
    """It slides on: N (5/2 + 3/2 mu) = 1 + e; a trial in which it sticks has a negative normal impulse."""
    push = 1.5 / (2.5 + 1.5 * 0.3)
    np.testing.assert_allclose(tip(3, 0.5, 0.3), after_impulses(3, push, -0.3 * push), rtol=1e-10)


def test_friction_of_an_impact_opposes_the_sliding_after_it():
    """The normal impulse turns the sliding round, and friction with it: N (5/2 - 3/2 mu) = 1 + e."""
    push = 1.5 / (2.5 - 1.5 * 0.3)
    after = tip(0.3, 0.5, 0.3)
    np.testing.assert_allclose(after, after_impulses(0.3, push, 0.3 * push), rtol=1e-10)
    assert after[0] + after[2] / np.sqrt(8) < 0


def test_restitution_is_dropped_where_sticking_would_feed_in_energy():
    """With e = 1 the end that sticks would leave with more energy than it came; without restitution it stays."""
    speeds = np.array([[2.5, -1.5], [-1.5, 2.5]])
    lively, dead = (np.linalg.solve(speeds, [1 + e, -0.3]) for e in (1, 0))
    assert abs(lively[1]) < lively[0]
    assert 0.5 * lively @ (np.array([-1, 0.3]) + [1, 0]) > 0.01
    np.testing.assert_allclose(tip(0.3, 1, 1), after_impulses(0.3, *dead), rtol=1e-9)


def check_study(samples):
    """Compare realisations of a rod of random angle, speeds and law with all solutions of the law."""
    number = {
        name: uqmbd.RandomVariable(name, chaospy.Uniform(*bounds))
        for name, bounds in {"x": (-2, 4), "w": (-1.5, 3), "e": (0, 1), "mu": (0, 1), "a": (0.3, 1.2)}.items()
    }
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    angle, motion = number["a"], {"velocity": (number["x"], -1), "angular_velocity": number["w"]}
    place = (0, 0.5 * sympy.sin(angle) + sympy.Rational(1, 1000))
    body = mechanism.body("rod", mass=1, inertia=1 / 12, position=place, angle=angle, **motion)
    law = {"restitution": number["e"], "friction": number["mu"]}
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, ZERO, (-0.5, 0), (0, 1), **law))
    for name, x in (("vx", body.velocity[0]), ("vy", body.velocity[1]), ("w", body.angular_velocity)):
        mechanism.output(name, x)
    study = uqmbd.Study("rods", mechanism, [0, 0.01], MonteCarlo(samples=samples, seed=1))
    data = study.run()["monte-carlo/samples"].to_dataset()
    inputs = {name: data["inputs"].sel(input=name).values for name in number}
    after = np.array([data["response"].sel(output=name).isel(time=1).values for name in ("vx", "vy", "w")]).T
    assert np.isfinite(after).all()
    mass = np.diag([1, 1, 1 / 12])
    for k in range(samples):
        x, w, e, mu, angle = (inputs[name][k] for name in ("x", "w", "e", "mu", "a"))
        height = 0.001 + 0.5 * np.sin(angle)
        when = scipy.optimize.brentq(lambda t, h=height, a=angle, w=w: h - t - 0.5 * np.sin(a + w * t), 0, 0.01)
        angle_then = angle + w * when
        arm = -0.5 * np.array([np.cos(angle_then), np.sin(angle_then)])
        rows = np.array([[0, 1, arm[0]]]), np.array([[1, 0, -arm[1]]])
        possible = outcomes(mass, *rows, np.array([x, -1, w]), np.array([e]), np.array([mu]))
        assert min(np.abs(after[k] - found).max() for found in possible) < 1e-6


@pytest.mark.thorough
def test_every_realisation_of_a_study_is_one_of_the_solutions_of_the_law():
    check_study(40)


@pytest.mark.slow
def test_every_realisation_of_a_large_study_is_one_of_the_solutions_of_the_law():
    check_study(2000)


def box(rng, corners, space):
    """Inertia, rows and velocity of a body that comes down on corners at random, all of which approach the floor."""
    turns = 3 if space == 3 else 1
    spin = np.diag(rng.uniform(0.05, 0.5, turns))
    mass = np.block([[np.eye(space), np.zeros((space, turns))], [np.zeros((turns, space)), spin]])
    tilt = rng.choice([0.0, 0.3])
    across, along = np.zeros((corners, space + turns)), np.zeros((corners, space - 1, space + turns))
    for k in range(corners):
        arm = np.append(rng.uniform(-1, 1, space - 1), -0.5)
        normal = np.append(tilt * rng.normal(size=space - 1), 1)
        normal /= np.linalg.norm(normal)
        frame = np.linalg.qr(np.column_stack([normal, np.eye(space)[:, : space - 1]]))[0]
        turn = np.cross(np.eye(3), arm).T if space == 3 else np.array([[-arm[1]], [arm[0]]])
        rows = np.hstack([np.eye(space), -turn.T if space == 3 else turn])
        across[k], along[k] = normal @ rows, frame[:, 1:].T @ rows
    velocity = np.append(2 * rng.normal(size=space - 1), [-2, *(0.3 * rng.normal(size=turns))])
    return mass, across, along, velocity


def check_law(mass, across, along, before, after, impulse, e, mu):
    """Signorini's, Newton's and Coulomb's laws, and the balance of momentum and energy."""
    impulse = impulse.reshape(len(mu), -1)
    push, rub, fast = impulse[:, 0], impulse[:, 1:], np.abs(across @ before).max()
    momentum = across.T @ push + np.einsum("ktn,kt->n", along, rub)
    np.testing.assert_allclose(mass @ (after - before), momentum, atol=1e-9 * fast)
    opens = across @ after + e * np.minimum(across @ before, 0)
    assert push.min() >= -1e-9 * fast
    assert opens.min() >= -1e-9 * fast
    assert np.abs(push * opens).max() < 1e-9 * fast**2
    sliding, drag = along @ after, np.linalg.norm(rub, axis=1)
    assert (drag <= mu * push + 1e-9 * fast).all()
    speed = np.linalg.norm(sliding, axis=1)
    # friction against the sliding, at its limit, wherever there is any
    np.testing.assert_allclose(rub * speed[:, None], -(mu * push)[:, None] * sliding, atol=1e-8 * fast**2)
    if not e:
        assert after @ mass @ after <= before @ mass @ before * (1 + 1e-9)


def many(space, corners, samples, seed):
    """How many collisions have a solution without restitution, and with it, of how many; each satisfies the laws."""
    rng = np.random.default_rng(seed)
    dead = lively = 0
    for _ in range(samples):
        mass, across, along, velocity = box(rng, corners, space)
        mu = rng.uniform(0, rng.choice([0.3, 1.5]), corners)
        contacts = contacts_of(mass, across, along, velocity, mu, mu)
        touches = tuple(Touch(contacts.normal(k), tuple(contacts.tangents(k)), float(mu[k])) for k in range(corners))
        for e in (0.0, 0.5):
            wanted = -e * np.minimum(across @ velocity, 0)
            collision = Collision(contacts.delassus[0], contacts.speed[0], touches, wanted)
            for impulse in solutions(collision):
                after = velocity + contacts.answer[0] @ impulse
                check_law(mass, across, along, velocity, after, impulse, e, mu)
                dead, lively = dead + (e == 0), lively + (e > 0)
                break
    return dead, lively


@pytest.mark.parametrize("space", [2, 3])
@pytest.mark.parametrize("corners", [1, 2, 3, 4, 7])
def test_impulses_of_many_contacts_satisfy_the_law(space, corners):
    """Without restitution there always is a solution; with it, nearly always where friction is moderate."""
    dead, lively = many(space, corners, 10, seed=100 * space + corners)
    assert dead == 10
    assert lively >= 8


@pytest.mark.slow
@pytest.mark.parametrize("space", [2, 3])
@pytest.mark.parametrize("corners", [1, 2, 3, 4, 7])
def test_impulses_of_many_contacts_satisfy_the_law_for_many_boxes(space, corners):
    dead, lively = many(space, corners, 500, seed=200 * space + corners)
    assert dead == 500
    assert lively > 450


@pytest.mark.thorough
def test_a_rod_that_jams_between_two_rough_walls_comes_to_rest():
    """Hundreds of collisions in one instant leave speeds of the size of rounding; these satisfy the law as well."""
    rng, many = np.random.default_rng(5), 0
    for _ in range(400):
        first = rng.uniform(-np.pi, np.pi)
        directions = first + np.array([0.0, np.pi + rng.uniform(-0.3, 0.3)])
        normals = np.column_stack([np.cos(directions), np.sin(directions)])
        mass, across, along = rod(rng, rng.uniform(-1, 1, 2), normals)
        velocity = rng.normal(size=3) * [1, 1, 5]
        after = solved(mass, across, along[:, None], velocity, rng.random(2), rng.uniform(1, 5, 2))
        assert (across @ after >= -1e-9).all()
        assert after @ mass @ after <= velocity @ mass @ velocity * (1 + 1e-12)
        many += np.abs(after).max() < 1e-6
    assert many > 20


def test_forces_of_redundant_contacts_do_not_depend_on_which_states_are_looked_at_together():
    """Four contacts of three coordinates, whose inertia changes by a factor of a million from state to state."""
    rng = np.random.default_rng(8)
    slopes = rng.normal(size=(6, 4, 3))
    matrices = slopes @ (10.0 ** rng.uniform(-3, 3, (6, 3, 1)) * slopes.transpose(0, 2, 1))
    right = (matrices @ rng.normal(size=(6, 4, 1)))[:, :, 0]
    together = contact_forces(matrices, right, [0, 1, 2, 3], {})
    for k in range(6):
        alone = contact_forces(matrices[k : k + 1], right[k : k + 1], [0, 1, 2, 3], {})[0]
        np.testing.assert_allclose(together[k], alone, rtol=1e-9, atol=1e-12 * np.abs(alone).max())
        np.testing.assert_allclose(matrices[k] @ alone, right[k], atol=1e-8 * np.abs(right[k]).max())

"""Event-aligned chaos: exact where a plain expansion stalls, split where sequences of events differ, and stored."""

from __future__ import annotations

import dataclasses

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.cli.compare import show_comparison
from uqmbd.results import AlignedChaos, load, save, study_tree, validate
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_springs import SpringDamper

G = 9.81
TIMES = np.round(np.arange(0, 2.001, 0.02), 10)
HEIGHT = uqmbd.RandomVariable("h0", chaospy.Uniform(0.9, 1.1), units="m")
RESTITUTION = uqmbd.RandomVariable("e", chaospy.Uniform(0.75, 0.85), units="1")


def ball(times=TIMES, restitution=RESTITUTION):
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("ball", mass=1, position=(0, HEIGHT), velocity=(0, 0))
    ground = mechanism.ground
    floor = mechanism.add(PlaneImpact("floor", ground, body, (0, 0), (0, 0), (0, 1), restitution=restitution))
    mechanism.output("height", body.position[1], units="m")
    mechanism.output("velocity", body.velocity[1], units="m/s")
    mechanism.output("second", floor.event_time("impact", 2), units="s")
    return uqmbd.Study("ball", mechanism, times=times, propagators=[])


def thrown(height, restitution, times):
    """Height and velocity of a bouncing ball, and its first impacts: closed form, arrays of samples."""
    h, e = np.asarray(height)[:, None], np.asarray(restitution)[:, None]
    speed, at = np.sqrt(2 * G * h), np.sqrt(2 * h / G)
    y, v = h - G * times**2 / 2, -G * times * np.ones_like(h)
    impacts = []
    for _ in range(12):
        impacts.append(at[:, 0])
        speed = speed * e
        since = times - at
        y = np.where(since >= 0, speed * since - G * since**2 / 2, y)
        v = np.where(since >= 0, speed - G * since, v)
        at = at + 2 * speed / G
    return y, v, np.array(impacts).T


@pytest.fixture(scope="module")
def aligned():
    return ball().propagate(Collocation(order=5, alignment="events"))


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(0)
    return rng.uniform(0.9, 1.1, 1000), rng.uniform(0.75, 0.85, 1000)


def inputs(chaos, samples):
    """Columns in the order of the chaos."""
    known = {"h0": samples[0], "e": samples[1]}
    return np.stack([known[name] for name in chaos.germ_names], axis=1)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of the plain chaos
def test_it_is_exact_where_a_plain_chaos_stalls(aligned, samples):
    """Over samples, with fewer than 100 realisations: 1e-6 against the closed form; the plain chaos errs by 5e-3."""
    assert aligned.attrs["realisations"] < 100
    exact = thrown(*samples, TIMES)[0]
    chaos = AlignedChaos.from_dataset(aligned["aligned"])
    error = chaos.evaluate(inputs(chaos, samples))[:, 0] - exact
    assert np.sqrt((error**2).mean()) < 1e-7
    with pytest.warns(UserWarning, match="looks discontinuous, or has a kink"):
        plain = ball().propagate(Collocation(order=5))
    plain = uqmbd.results.PolynomialChaos.from_dataset(plain["chaos"])
    error = plain.evaluate(inputs(plain, samples))[:, 0] - exact
    assert np.sqrt((error**2).mean()) > 2e-3


@pytest.mark.thorough
def test_it_converges_with_the_order(samples):
    """Exponentially: an order divides the error at least by five."""
    exact = thrown(*samples, TIMES)[0]
    errors = []
    for order in (2, 3):
        chaos = AlignedChaos.from_dataset(ball().propagate(Collocation(order=order, alignment="events"))["aligned"])
        errors.append(np.sqrt(((chaos.evaluate(inputs(chaos, samples))[:, 0] - exact) ** 2).mean()))
    assert errors[1] < errors[0] / 5


def test_event_times_and_aligned_velocities(aligned, samples):
    """The velocity jumps at a fixed time; in aligned time it does not."""
    chaos = AlignedChaos.from_dataset(aligned["aligned"])
    exact = thrown(*samples, TIMES)[2]
    edges = chaos.edges(inputs(chaos, samples))
    np.testing.assert_allclose(edges[:, 1:6], exact[:, :5], atol=1e-7)
    where = np.array([0.0, 0.5, 1.0])
    velocity = chaos.aligned(inputs(chaos, samples), where)[:, 1:4, 1]
    for k in range(3):
        begin, end = exact[:, k], exact[:, k + 1]
        rise = samples[1] ** (k + 1) * np.sqrt(2 * G * samples[0])
        expected = rise[:, None] - G * where * (end - begin)[:, None]
        np.testing.assert_allclose(velocity[:, k], expected, atol=1e-6)


def test_statistics_and_the_stated_error(aligned):
    """Mean and standard deviation at 1.9 s, after two or three impacts, against the closed form of many samples."""
    rng = np.random.default_rng(1)
    at = int(np.argmin(abs(TIMES - 1.9)))
    y, v, _ = thrown(rng.uniform(0.9, 1.1, 400_000), rng.uniform(0.75, 0.85, 400_000), TIMES[at : at + 1])
    statistics = aligned["statistics"]
    most = statistics["std"].max("time").values
    for k, (exact, limit) in enumerate(((y, 0.005), (v, 0.01))):
        assert abs(statistics["mean"].values[k, at] - exact.mean()) < limit * most[k]
        assert abs(statistics["std"].values[k, at] - exact.std()) < limit * most[k]
    assert float(statistics["verification_error"].sel(output="height").max()) < 1e-5
    first = statistics["sobol_first"].values
    assert ((first >= 0) & (first <= 1)).all()


@pytest.mark.thorough
def test_verification_may_be_left_out(aligned):
    """The expansion is the same, and nothing is stated of its error."""
    bare = ball().propagate(Collocation(order=5, alignment="events", verify=0))
    assert np.array_equal(bare["statistics"]["mean"], aligned["statistics"]["mean"])
    assert set(bare["nodes"]["purpose"].values.tolist()) == {"fit"}
    assert "verification_error" not in bare["statistics"] or np.isnan(bare["statistics"]["verification_error"]).all()


@pytest.mark.thorough
def test_it_is_stored(aligned, tmp_path):
    tree = study_tree([aligned], study="ball", mechanism="ball")
    save(tree, tmp_path / "results.nc")
    stored = AlignedChaos.from_dataset(load(tmp_path / "results.nc")["collocation"]["aligned"])
    here = AlignedChaos.from_dataset(aligned["aligned"])
    values = [[0.8, 1.0]] if here.germ_names[0] == "e" else [[1.0, 0.8]]
    np.testing.assert_array_equal(stored.evaluate(values), here.evaluate(values))
    assert stored.elements[0].events[:2] == ("floor: impact", "floor: impact")
    assert float(aligned["scalars"]["statistics"]["mean"].sel(output="second")) == pytest.approx(1.1733, abs=1e-3)


@pytest.mark.thorough
def test_germ_space_is_split_where_the_sequence_of_events_differs():
    """A mass on a spring that reaches a wall only where it is released far enough."""
    release = uqmbd.RandomVariable("release", chaospy.Uniform(0.5, 1.5), units="m")
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(-release, 0), velocity=(0, 0))
    ground = mechanism.ground
    mechanism.add(SpringDamper("spring", ground, mass, (0, 0), (0, 0), stiffness=4))
    mechanism.add(PlaneImpact("wall", ground, mass, (0.9, 0), (0, 0), (-1, 0), restitution=0.5))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("wall", mechanism, times=np.linspace(0, 2, 41), propagators=[])
    with pytest.warns(UserWarning, match="in some of the .* realisations have different sequences of events"):
        node = study.propagate(Collocation(order=3, alignment="events", max_elements=8))
    chaos = AlignedChaos.from_dataset(node["aligned"])
    edges = sorted({x for e in chaos.elements for x in (*e.box.lower, *e.box.upper)})
    # the germ runs from -1 to 1, the release from 0.5 to 1.5 m
    assert any(abs(x + 0.2) < 0.05 for x in edges)
    assert {e.events[0] for e in chaos.elements} >= {"", "wall: impact"}
    free = chaos.evaluate([[0.7]])[0, 0]
    np.testing.assert_allclose(free, -0.7 * np.cos(2 * np.linspace(0, 2, 41)), atol=1e-5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"alignment": "impacts"}, "alignment is 'impacts'; expected one of 'events', 'phase'"),
        ({"alignment": "events", "clock": "wheel"}, "clock='wheel' requires alignment='phase'"),
    ],
)
def test_options_that_contradict_alignment(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Collocation(**options)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "options",
    [
        {"order": 4, "rule": "smolyak"},
        {"order": 4, "method": "regression"},
        {"order": 1, "adaptive": "order", "tolerance": 1e-5},
        {"order": 3, "elements": 3},
    ],
)
def test_every_way_to_fit_follows_events(options, samples):
    exact = thrown(*samples, TIMES)[0]
    found = ball().propagate(Collocation(alignment="events", **options))
    chaos = AlignedChaos.from_dataset(found["aligned"])
    error = chaos.evaluate(inputs(chaos, samples))[:, 0] - exact
    assert np.sqrt((error**2).mean()) < 1e-4


def test_a_mechanism_without_events_is_reported():
    mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("ball", mass=1, position=(0, HEIGHT))
    mechanism.output("height", body.position[1], units="m")
    study = uqmbd.Study("falling", mechanism, times=[0, 1], propagators=[])
    with pytest.raises(uqmbd.StudyError, match="needs a mechanism with events"):
        study.propagate(Collocation(alignment="events"))


@pytest.mark.thorough
def test_bounces_that_die_down_are_reported():
    """Nearly endless sequences cannot be followed; the message says what to do."""
    study = ball(times=np.linspace(0, 6, 61), restitution=RESTITUTION)
    with pytest.raises(uqmbd.StudyError, match="sequence of decaying bounces"):
        study.propagate(Collocation(order=1, alignment="events"))


@pytest.mark.thorough
def test_verification_realisations_that_fail_are_counted_and_named(monkeypatch):
    """Two of sixteen fail: a warning, their number, and their inputs with the reason."""
    real = uqmbd.extend.Problem.realise

    def some_fail(self, values, **options):
        found = real(self, values, **options)
        if self.timeless:
            return found
        status = found.status.copy()
        status[:2] = 2
        messages = tuple("planted" if k < 2 else m for k, m in enumerate(found.messages))
        response = np.where((status == 0)[:, None, None], found.response, np.nan)
        return dataclasses.replace(found, status=status, messages=messages, response=response)

    study = ball(times=np.linspace(0, 1.5, 11))
    with monkeypatch.context() as patched:
        patched.setattr(uqmbd.extend.Problem, "realise", some_fail)
        with pytest.warns(UserWarning, match=r"2 of 16 verification realisations failed; .*: planted"):
            node = study.propagate(Collocation(order=2, alignment="events"))
    assert (node.attrs["failures"], node.attrs["verification"]) == (2, 14)
    nodes = node["nodes"].to_dataset()
    failed = nodes.isel(node=np.flatnonzero(nodes["status"].values))
    assert failed["message"].values.tolist() == ["planted"] * 2
    assert failed["purpose"].values.tolist() == ["verification"] * 2
    assert ((failed["inputs"].sel(input="h0") > 0.9) & (failed["inputs"].sel(input="h0") < 1.1)).all()
    assert node["aligned"].sizes["verification"] == 14


@pytest.mark.slow
def test_a_comparison_of_files_keeps_what_the_files_hold(tmp_path, capsys, monkeypatch):
    """Outputs without a time, event-aligned chaoses and nodes: at the common times, in the file and its comparison."""
    runs = {"one": (TIMES[:76:5], 2), "two": (TIMES[:76:15], 3)}
    for name, (times, order) in runs.items():
        node = ball(times=times).propagate(Collocation(order=order, alignment="events"))
        save(study_tree([node], study="ball", mechanism="ball"), tmp_path / name / "results.nc")
    monkeypatch.setattr("uqmbd.cli.report.write", lambda tree, path, **_: path)  # whose figures take their time
    show_comparison([tmp_path / name for name in runs], out=tmp_path / "both")
    assert "second" in capsys.readouterr().out
    both = load(tmp_path / "both" / "comparison.nc")
    validate(both)
    assert both["comparison"]["scalar_verdict_kind"].sel({"method": "B collocation", "scalar": "second"}) == "agrees"
    for letter, name in zip("AB", runs, strict=True):
        given, kept = load(tmp_path / name / "results.nc")["collocation"], both[f"{letter} collocation"]
        assert {part.path.split("collocation")[1] for part in given.subtree} == {
            part.path.split("collocation")[1] for part in kept.subtree
        }
        np.testing.assert_array_equal(kept["nodes"]["inputs"], given["nodes"]["inputs"])
        np.testing.assert_array_equal(kept["scalars/statistics"]["mean"], given["scalars/statistics"]["mean"])
        whole, part = (AlignedChaos.from_dataset(node["aligned"]) for node in (given, kept))
        values = [[0.8, 1.0]] if whole.germ_names[0] == "e" else [[1.0, 0.8]]
        np.testing.assert_array_equal(part.labels.times, TIMES[:76:15])
        at = np.isin(whole.labels.times, part.labels.times)
        np.testing.assert_array_equal(part.evaluate(values), whole.evaluate(values)[..., at])


@pytest.mark.parametrize("exponent", [-45, 30, -300])
def test_statistics_know_no_units(aligned, exponent):
    """Outputs in other units, of numbers however small, have the same shape and the same shares of variance."""
    chaos = AlignedChaos.from_dataset(aligned["aligned"])
    elements = [dataclasses.replace(e, segments=np.ldexp(e.segments, exponent)) for e in chaos.elements]
    other = dataclasses.replace(
        chaos, elements=tuple(elements), verification_germs=None, verification_response=None, verification_weights=None
    ).statistics()
    known = chaos.statistics()
    for name in ("skewness", "kurtosis", "sobol_first", "sobol_total"):
        np.testing.assert_allclose(other[name], known[name], rtol=1e-9, atol=1e-9)
    for name in ("mean", "std"):
        np.testing.assert_allclose(np.ldexp(other[name], -exponent), known[name], rtol=1e-12)

"""Models from the cache: their key changes with all that they are made from, and they are those that were built."""

from __future__ import annotations

import collections
import functools
import importlib
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.compiled import compilations
from uqmbd.dynamics import build
from uqmbd.dynamics.model_key import Digests, compute_model_key
from uqmbd.laws import length
from uqmbd_contact import ContactLaw, PlaneContact, depth
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import NonlinearSpringDamper, PointForce, SpringDamper, Torque

from ..mechanisms import driven_slider_crank

ROOT = Path(uqmbd.__file__).parents[1]
PLUGINS = Path(uqmbd.__file__).parents[1] / "plugins"
TIMES = np.linspace(0, 0.2, 5)

PLACES: Mapping[str, tuple[Any, ...]] = {
    "name": ("machine", "other"),
    "gravity": (-9.81, -9.8, -9.810000000000002),
    "body": ("crank", "wheel"),
    "mass": (1.0, 1.1, 1.0000000000000002, 1),
    "com": (0.0, 0.1),
    "inertia": (0.02, 0.03),
    "position": (0.1, 0.100001),
    "angle": (0.3, 0.31),
    "hold": (False, True),
    "speed": (None, 0.0, 1.0),
    "mean": (5.0, 5.1),
    "random": ("k", "stiffness"),
    "random_place": ("stiffness", "damping", "none"),
    "factor": (2.0, 2.0000000000000004),
    "power": (3, 5),
    "law": ("cubic", "table"),
    "table": (0.0, 1e-15, 0.5),
    "ends": ("natural", "flat"),
    "beyond": ("constant", None),
    "force": (0.2, 0.3),
    "frequency": (3, 4),
    "second": ("none", "torque", "driver"),
    "contact": ("none", "hertz", "hunt-crossley", "own", "other"),
    "output": ("x", "y"),
    "units": ("m", "N"),
    "recorded": ("position", "velocity", "reaction", "angle", "energy"),
    "turns": (False, True),
    "start": (None, 0.1, 0.2),
    "time": (0.0, 0.5),
    "fuse": (None, True, False),
}
"""Where a mechanism may differ, and values there, the usual one first."""

USUAL = {key: values[0] for key, values in PLACES.items()}


def machine(spec: Mapping[str, Any], *, otherwise: bool = False) -> uqmbd.Mechanism:
    """Make a mechanism; `otherwise` where nothing changes by it."""
    s = {**USUAL, **spec}
    m = uqmbd.Mechanism(s["name"], uqmbd.Planar(gravity=(0, s["gravity"])))
    inertial = {"mass": s["mass"], "inertia": s["inertia"], "com": (s["com"], 0)}
    drawn = {"position": (s["position"], 0), "angle": s["angle"], "angular_velocity": s["speed"], "hold": s["hold"]}
    given = {**drawn, **inertial} if otherwise else {**inertial, **drawn}
    crank = m.body(s["body"], **given)
    bob = m.body("bob", mass=1, inertia=0.01, position=(1, 0))
    k = uqmbd.RandomVariable(s["random"], chaospy.Uniform(s["mean"] - 1, s["mean"] + 1))
    pivot = m.add(Revolute("pivot", m.ground, crank, (0, 0), (0, 0)))
    m.add(Prismatic("slide", m.ground, bob, (0, 0), (0, 0), (1, 0), (1, 0)))
    numbers: dict[str, Any] = {"stiffness": 30.0, "damping": 0.5} | (
        {s["random_place"]: s["factor"] * k} if s["random_place"] != "none" else {}
    )
    m.add(SpringDamper("spring", crank, bob, (0.1, 0), (0, 0), free_length=0.8, **numbers))
    knots, values = [0.0, 0.5, 1.0, 2.0], [-1.0 + s["table"], 0.0, 2.0, 4.0]
    table = uqmbd.spline(knots, values, ends=s["ends"], beyond=s["beyond"])(length)
    cubic = s["factor"] * (length - 0.5) ** s["power"]
    law = table if s["law"] == "table" else cubic
    m.add(NonlinearSpringDamper("law", m.ground, bob, (0, 0), (0, 0), law=law))
    swing = sympy.cos(s["frequency"] * uqmbd.t)
    load = s["force"] + swing if otherwise else swing + s["force"]
    m.add(PointForce("load", bob, (0, 0), (load, 0)))
    if s["second"] == "torque":
        m.add(Torque("second", crank, s["force"]))
    if s["second"] == "driver":
        m.add(RotationDriver("second", m.ground, crank, angle=s["angle"] + 2 * uqmbd.t))
    laws = {"own": ContactLaw(2000 * depth**2), "other": ContactLaw(2001 * depth**2)}
    if s["contact"] != "none":
        law = laws.get(s["contact"], s["contact"])
        m.add(PlaneContact("stop", m.ground, bob, (3, 0), (0, 0), (-1, 0), radius=0.1, law=law))
    observed = {
        "position": bob.position[0] * s["factor"],
        "velocity": 1.0 * bob.velocity[0],
        "reaction": 1.0 * pivot.reaction_force[0],
        "angle": 1.0 * crank.angle + 1.0 * crank.angular_velocity,
        "energy": k * bob.position[0],
    }
    m.output(s["output"], observed[s["recorded"]], units=s["units"])
    m.output("direction", sympy.atan2(*crank.point((1, 0))[::-1]), units="rad", angle=s["turns"])
    if s["start"] is not None:
        m.start(bob.velocity[0], s["start"])
    return m


def facts(spec: Mapping[str, Any], **options: Any) -> str | None:
    s = {**USUAL, **spec}
    return compute_model_key(machine(spec, **options), s["time"], s["fuse"])


def seen(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return those differences that a mechanism has: a value in a part that it has not means nothing."""
    s = {key: (type(value), value) for key, value in {**USUAL, **spec}.items()}
    used = "random_place" not in spec or spec["random_place"] != "none" or spec.get("recorded") == "energy"
    drop = []
    if s["law"][1] != "table":
        drop += ["table", "ends", "beyond"]
    else:
        drop += ["power"]
    if s["law"][1] == "table" and s["ends"][1] == "natural":
        s["beyond"] = s["beyond"][1] or "constant"
    if s["law"][1] == "table" and s["ends"][1] == "flat":
        drop += ["beyond"]
    if not used:
        drop += ["mean", "random"]
    if s["law"][1] == "table" and s["random_place"][1] == "none" and s["recorded"][1] != "position":
        drop += ["factor"]
    return {key: value for key, value in s.items() if key not in drop}


specs = st.fixed_dictionaries({}, optional={key: st.sampled_from(values) for key, values in PLACES.items()})


@pytest.mark.thorough
@settings(max_examples=20, deadline=None)
@given(one=specs, other=specs)
def test_facts_are_the_same_if_and_only_if_the_mechanisms_are(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert facts(one) is not None
    assert facts(one) == facts(one, otherwise=True), "the order in which things are said means nothing"
    assert (facts(one) == facts(other)) == (seen(one) == seen(other))


@pytest.mark.parametrize("key", PLACES)
def test_each_place_alone_changes_the_facts(key: str) -> None:
    beside: dict[str, Any] = {"law": "table"} if key in ("table", "ends", "beyond") else {}
    if key == "beyond":
        return  # the default is the other one
    known = [facts({**beside, key: value}) for value in PLACES[key]]
    assert len(set(known)) == len(known)
    assert None not in known


GAIN = 2.0
TABLE = {"gain": 3.0}


def shaped(value: Any) -> Any:
    """A helper that components of third parties call."""
    return value * GAIN


class Shape:
    """An object with a state, as third parties hold it."""

    def __init__(self, power: int) -> None:
        self.power = power


SHAPE = Shape(2)


def cart(kind: type[uqmbd.Component], **attributes: Any) -> uqmbd.Mechanism:
    m = uqmbd.Mechanism("cart", uqmbd.Translational())
    body = m.body("cart", mass=1, position=(1, 0))
    spring = m.add(kind("spring", m.ground, body, (0, 0), (0, 0), 5))
    vars(spring).update(attributes)
    m.output("x", body.position[0])
    return m


def third_party(factor: float = 1.0, default: float = 0.0) -> type[uqmbd.Component]:
    """A component with a closure, a default, a helper, and globals."""

    class Third(SpringDamper):
        share = 0.5

        def terms(self, p: Any, extra: float = default) -> Any:
            scale = shaped(factor) + TABLE["gain"] + SHAPE.power + self.share + extra
            return [uqmbd.Potential(scale * term.energy) if isinstance(term, uqmbd.Potential) else term
                    for term in SpringDamper.terms(self, p)]  # fmt: skip

    Third.__qualname__ = "Third"
    return Third


def test_components_of_third_parties_have_keys_that_follow_their_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same code with the same values has one key; each part of it that the equations may depend on another."""
    usual = compute_model_key(cart(third_party()))
    assert usual is not None and usual == compute_model_key(cart(third_party()))
    assert usual != compute_model_key(cart(SpringDamper))
    found = [usual, compute_model_key(cart(third_party(factor=1.5))), compute_model_key(cart(third_party(default=1.0)))]
    found.append(compute_model_key(cart(third_party(), gain=3)))
    here = sys.modules[__name__]
    changes: list[tuple[Any, str, Any]] = [
        (here, "GAIN", 2.5),
        (here, "TABLE", {"gain": 3.5}),
        (here, "SHAPE", Shape(3)),
        (here, "shaped", lambda value: value),
        (Shape, "scale", 2.0),
    ]
    for target, name, value in changes:
        with monkeypatch.context() as patch:
            patch.setattr(target, name, value, raising=False)
            found.append(compute_model_key(cart(third_party())))
    assert len(set(found)) == len(found) and None not in found
    with monkeypatch.context() as patch:
        kind = third_party()
        patch.setattr(kind, "share", 0.6)
        assert compute_model_key(cart(kind)) not in (None, *found)
    assert compute_model_key(cart(third_party())) == usual


def test_what_is_not_known_has_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    here = sys.modules[__name__]
    source = open(__file__, encoding="utf-8")  # noqa: SIM115 - an object of a compiled library
    with source:
        contents = collections.OrderedDict(gain=1.0), collections.Counter("a"), np.ma.array([1.0], mask=[True])
        reading = functools.partial(np.load, "gain.npy"), lambda: vars(here)["SHAPE"]
        code = lambda: __import__("chaospy"), importing
        for unknown in (source, iter([1]), sys.modules["chaospy"], *code, *contents, *reading):
            with monkeypatch.context() as patch:
                patch.setattr(here, "SHAPE", unknown)
                assert compute_model_key(cart(third_party())) is None, unknown
    controlled = cart(SpringDamper)
    body = controlled.bodies["cart"]
    controlled.add(uqmbd.Controller("c", [body.position[0]], ["u"], 10.0, lambda time, measured: measured))
    assert compute_model_key(controlled) is None


def importing() -> Any:
    """Code of another package, which has no version in the key."""
    import chaospy

    return chaospy


def test_patches_change_the_key_or_leave_none(monkeypatch: pytest.MonkeyPatch) -> None:
    class Mine:
        """What can be called."""

        def __call__(self, *_: object) -> list[Any]:
            return []

    plain = cart(SpringDamper)
    known = compute_model_key(plain)
    assert known is not None
    posing = type("SpringDamper", (SpringDamper,), {"__module__": SpringDamper.__module__})
    assert compute_model_key(cart(posing)) != known
    original, own = SpringDamper.terms, SpringDamper.prepare

    @functools.wraps(original)
    def wrapped(self: Any, p: Any) -> Any:
        return original(self, p)

    patches: dict[str, list[Any]] = {
        "terms": [lambda self, p: [], wrapped, functools.partialmethod(original), functools.partial(print), Mine()],
        "prepare": [property(lambda self: own), classmethod(lambda cls: {}), staticmethod(dict)],
    }
    for name, values in patches.items():
        for value in values:
            for kind in (SpringDamper, uqmbd.Component):
                with monkeypatch.context() as patch:
                    patch.setattr(kind, name, value)
                    assert compute_model_key(plain) != known, (kind, name, value)
    assert compute_model_key(plain) == known
    with monkeypatch.context() as patch:
        patch.setattr("uqmbd_springs.spring.law_at", lambda *_: 0, raising=False)
        assert compute_model_key(cart(SpringDamper)) != known or "law_at" not in SpringDamper.terms.__code__.co_names
    with monkeypatch.context() as patch:
        patch.setattr("uqmbd.dynamics.equations.block.localised_expression", lambda *_: 0, raising=False)
        assert compute_model_key(plain) is None
    with monkeypatch.context() as patch:
        patch.setattr(SpringDamper, "symbol", "coil" if SpringDamper.symbol != "coil" else "damper")
        assert compute_model_key(plain) not in (None, known)
    assert compute_model_key(plain) == known


def pendulum(stiffness: Any = 20.0) -> uqmbd.Mechanism:
    """A pendulum with a spring, whose joint is there twice."""
    m = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = m.body("rod", mass=1, inertia=0.01, position=(0.1, 0))
    pivot = m.add(Revolute("A", m.ground, rod, (0, 0), (-0.1, 0)))
    m.add(Revolute("B", m.ground, rod, (0, 0), (-0.1, 0)))
    m.add(SpringDamper("spring", m.ground, rod, (0.5, 0), (0.1, 0), stiffness, 0.1, free_length=0.3))
    m.output("angle", rod.angle, units="rad")
    m.output("load", pivot.reaction_force[0], units="N")
    return m


def motion(**options: Any) -> bytes:
    """Bits of a motion, of a mechanism that is made anew."""
    m = pendulum(uqmbd.RandomVariable("k", chaospy.Uniform(10, 30)))
    with pytest.warns(uqmbd.RedundantConstraintWarning, match="2 of 5 constraint equations are redundant"):
        found = uqmbd.simulate(m, TIMES, values={"k": 22.0}, **options)
    return found["angle"].values.tobytes() + found["load"].values.tobytes()


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_model_from_the_cache_is_the_one_that_was_built(
    integrator: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    before = motion(integrator=integrator)
    compiled = compilations[0]

    called = set()
    sys.setprofile(lambda frame, event, _: called.add(frame.f_code.co_name))
    try:
        assert motion(integrator=integrator) == before
    finally:
        sys.setprofile(None)
    assert "compute_model_key" in called
    assert not called & {"stated", "terms", "_built"}
    assert compilations[0] == compiled


@pytest.mark.thorough
def test_what_only_some_integrators_take_is_compiled_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    m = pendulum()
    with pytest.warns(uqmbd.RedundantConstraintWarning):
        model = build(m)
    later = {"residual", "jacobian", "energy"}
    assert later <= set(model.evaluators)
    assert not later & model.evaluators.made.keys()
    with pytest.warns(uqmbd.RedundantConstraintWarning):
        uqmbd.simulate(m, TIMES)
    assert not later & model.evaluators.made.keys()
    travelled = pickle.loads(pickle.dumps(model))
    for one in (model, travelled):
        rows, pointers = one.pattern
        assert pointers[-1] == len(rows) == len(one.evaluators["jacobian"].targets)
        assert one.evaluators["residual"].targets
    assert model.evaluators["residual"].groups[0].kernel == travelled.evaluators["residual"].groups[0].kernel
    assert "nothing" not in model.evaluators
    with pytest.raises(KeyError):
        model.evaluators["nothing"]


KEY = """
import uqmbd
from uqmbd.dynamics.model_key import compute_model_key
from uqmbd_springs import SpringDamper

mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
body = mechanism.body("cart", mass=2, position=(1, 0))
mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), 5))
mechanism.output("x", body.position[0])
{after}
print(compute_model_key(mechanism))
"""


@pytest.mark.slow
def test_the_code_that_runs_is_in_the_key(tmp_path: Path) -> None:
    """An edit changes it in the next program; a comment, and an edit while a program runs, do not."""
    package = tmp_path / "uqmbd_springs"
    package.mkdir()
    for file in (PLUGINS / "uqmbd_springs").glob("*.py"):
        (package / file.name).write_bytes(file.read_bytes())
    edited = package / "spring.py"

    def told(after: str = "") -> str:
        path = os.pathsep.join([str(tmp_path), str(ROOT), str(PLUGINS), os.environ.get("PYTHONPATH", "")])
        environment = dict(os.environ, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1")
        command = [sys.executable, "-c", KEY.format(after=after)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    before = told()
    assert before != "None"
    edited.write_text(edited.read_text() + "\n# a comment\n")
    assert told() == before == told(f"open({str(edited)!r}, 'a').write('# another one')")
    edited.write_text(edited.read_text() + "\n\nSpringDamper.terms = lambda self, p: []\n")
    assert told() not in (before, "None")


def test_what_uqmbd_has_itself_is_known() -> None:
    """No component or space of its own goes the long way."""
    plain = driven_slider_crank(0.3)
    packages = [importlib.import_module(x) for x in ("uqmbd_contact", "uqmbd_drivers", "uqmbd_joints", "uqmbd_springs")]
    offered = [x for p in packages for x in vars(p).values() if isinstance(x, type) and issubclass(x, uqmbd.Component)]
    assert len(offered) > 30
    for kind in (*offered, uqmbd.Spatial, uqmbd.Planar, uqmbd.Translational, uqmbd.Line, uqmbd.Mechanism):
        found = Digests(plain)
        assert found.of(kind) and found.code(), kind
    assert compute_model_key(plain) is not None

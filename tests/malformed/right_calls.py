"""Right calls of public names that no example of a docstring makes, as examples; all are small."""

from __future__ import annotations

__all__ = ["EXAMPLES"]

_STONE = """
>>> import chaospy, numpy as np, uqmbd
>>> from uqmbd import extend, results
>>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
>>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
>>> stone = mechanism.body("stone", mass=1, velocity=speed)
>>> mechanism.output("x", stone.position[0], units="m")
>>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
>>> axes = extend.labels([("x", "m")], [("speed", "m/s")], [0.0, 0.5])
"""

EXAMPLES: dict[str, str] = {
    "surrogates": _STONE
    + """
>>> chaos = results.PolynomialChaos([[[2.0, 2.0]], [[0.0, 0.4]]], [[0], [1]], space, axes)
>>> checked = results.PolynomialChaos(
...     chaos.coefficients, chaos.multi_index, space, axes, np.array([[0.5], [-0.5]]), np.full((2, 1, 2), 2.0)
... )
>>> _ = chaos.evaluate([[2.0]])
>>> _ = chaos.gradient([[2.0]])
>>> _ = chaos.evaluate_germs([[0.5]])
>>> _ = chaos.sample(3, 1)
>>> _ = chaos.quantiles((0.1, 0.9), samples=64, seed=1)
>>> _ = chaos.circular(samples=64, seed=1)
>>> _ = chaos.density([1.5, 2.0], "x", 0.5, samples=64, seed=1)
>>> _ = chaos.statistics((0.1, 0.9), samples=64, seed=1)
>>> _ = chaos.to_xarray(samples=8, seed=1, probabilities=(0.1, 0.9))
>>> _ = chaos.verdicts(0.01)
>>> _ = checked.verification_error("x", 0.5)
>>> _ = checked.verification_factor(), checked.verification_rms(), checked.verification_std()
>>> _ = checked.horizon(0.01)
>>> _ = chaos.selected([0], times=[1])
>>> _ = checked.evaluate_germs([[0.5]])
""",
    "statistics": """
>>> import numpy as np
>>> from uqmbd import extend, results
>>> row = np.array([1.0])
>>> _ = extend.Moments(3, row, row, row, row)
>>> _ = extend.Violations(np.array([[[1]]]), 4, 1)
>>> _ = extend.CircularMoments(2, row, row, row, row)
>>> _ = extend.Labels((extend.OutputInfo("x"),), (extend.InputInfo("a"),), np.array([0.0]))
""",
    "elements": """
>>> import chaospy, numpy as np, uqmbd
>>> from uqmbd import extend, results
>>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
>>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
>>> stone = mechanism.body("stone", mass=1, velocity=speed)
>>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
>>> box = uqmbd.extend.GermBox.whole(space)
>>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])
>>> element = extend.AlignedElement(box, ("stop", ""), edges, np.zeros((2, 2, 1, 3)), "events")
>>> one = extend.AlignedElement.through(
...     extend.GermBox.whole(box.local), ("",), np.array([[0.0, 1.0]]), np.zeros((1, 1, 1, 3)), "time"
... )
>>> aligned = results.AlignedChaos((one,), np.array([[0]]), extend.labels(["x"], ["speed"], [0.5]))
>>> _ = results.AlignedChaos.joined([aligned], [box])
>>> _ = uqmbd.extend.GermBox(space, (0.0,), (1.0,))
>>> _ = box.contains([[0.5]])
>>> _ = box.divisible(0)
>>> _ = uqmbd.extend.GermSpace(space.inputs, space.germs, space.groups)
>>> _ = space.to_germs([[2.0]])
>>> _ = space.from_uniform([[0.5]])
>>> inputs = uqmbd.extend.JointInput((speed,))
>>> _ = inputs.from_uniform(np.array([[0.5]]))
>>> _ = inputs.replaced([speed])
>>> _ = uqmbd.extend.JointInput.of([speed])
>>> _ = uqmbd.extend.Quadrature(np.zeros((1, 1)), np.ones(1), 1, "gauss")
>>> points = uqmbd.extend.VerificationPoints(np.zeros((2, 1)), np.full(2, 0.5))
>>> _ = points.share(np.array([True, False]))
>>> _ = uqmbd.extend.VerificationPoints.of_elements([box], 0, 4, 0, 1)
>>> _ = uqmbd.extend.VerificationPoints.further(40)
>>> verified = uqmbd.extend.Verification(space, points, np.zeros((2, 1, 1)), asked=2)
>>> _ = uqmbd.extend.Verification.failed_share([verified], [1.0], 4, 0)
""",
    "clocks": """
>>> import numpy as np, uqmbd
>>> times = np.linspace(0, 2, 21)
>>> turning = np.array([6.0, 7.0])[:, None, None] * times
>>> found = uqmbd.extend.Dense(times, turning, error=0.0)
>>> clock = uqmbd.extend.Clock("angle", row=0, turn=2 * np.pi)
>>> _ = clock.fitted(found)
>>> phases = uqmbd.extend.Phases(times, turning[:, 0])
>>> _ = phases.steadiness(2.0)
""",
    "descriptions": """
>>> import uqmbd
>>> stiffness = uqmbd.Parameter("N/m", "spring rate", default=0, minimum=0)
>>> _ = stiffness.offers(1.0), stiffness.allows(1.0)
>>> _ = stiffness.fits(uqmbd.Line()), stiffness.size(uqmbd.Line())
>>> _ = uqmbd.extend.Bounds(0, 1).hold(0.5)
>>> _ = uqmbd.extend.Toleranced(30.0, 29.9, 30.1, 1.33, False, "tolerance")
>>> _ = uqmbd.extend.Sizing(option="samples", at=lambda size: size, least=2)
""",
    "arguments": """
>>> import uqmbd
>>> def share(part: float, of: float = 1.0) -> float:
...     return part / of
>>> _ = uqmbd.extend.typechecked(share)(0.5)
""",
    "methods": _STONE
    + """
>>> from uqmbd_montecarlo import LowFidelity, MonteCarlo
>>> from uqmbd_collocation import Collocation
>>> from uqmbd_galerkin import Galerkin
>>> from uqmbd_reliability import Reliability
>>> mechanism.require("near", stone.position[0] <= 10)
>>> study = uqmbd.Study("stone", mechanism, [0.0, 0.5])
>>> low = LowFidelity(study, cost=0.1)
>>> _ = MonteCarlo(samples=8, seed=1)
>>> _ = Collocation(order=1)
>>> _ = Galerkin(order=1)
>>> _ = Reliability(max_realisations=500)
""",
    "models": """
>>> from pathlib import Path
>>> import uqmbd
>>> from uqmbd_models import MJCF, URDF
>>> inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
>>> arm = f'<link name="arm"><inertial><mass value="1"/>{inertia}</inertial></link>'
>>> hinge = '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
>>> _ = Path("robot.urdf").write_text(f'<robot name="robot"><link name="base"/>{arm}{hinge}</robot>')
>>> robot = uqmbd.from_urdf("robot.urdf")
>>> _ = URDF().read("robot.urdf")
>>> _ = URDF().read(Path("robot.urdf"), floating=False, fuse=True, outputs=True, inertia="as stated")
>>> ball = '<body name="arm"><joint name="hinge" axis="0 0 1"/><geom type="sphere" size="0.1" mass="1"/></body>'
>>> _ = Path("model.xml").write_text(f'<mujoco model="model"><worldbody>{ball}</worldbody></mujoco>')
>>> _ = uqmbd.from_mjcf("model.xml")
>>> _ = MJCF().read("model.xml")
""",
    "results": _STONE
    + """
>>> from uqmbd import report
>>> from uqmbd_collocation import Collocation
>>> from uqmbd_contact import PlaneImpact
>>> from uqmbd_montecarlo import MonteCarlo
>>> methods = [MonteCarlo(samples=8, seed=1), *(Collocation(order=k, label=f"order-{k}") for k in (1, 2))]
>>> tree = uqmbd.Study("stone", mechanism, [0.0, 0.5], methods).run(progress=False)
>>> nodes = {label: tree[label] for label in ("monte-carlo", "order-1", "order-2")}
>>> _ = results.validate(tree)
>>> _ = results.choose_reference(nodes, rtol=1e-6)
>>> _ = report.order_convergence(tree, "x", reference="order-2")
>>> _ = extend.Moments.of(np.array([[1.0], [2.0], [4.0]])).statistics(independent=False)
>>> _ = report.Curve("c", [1.0, 2.0, 3.0]).at(np.array([0, 2]))
>>> dense = extend.Dense(np.linspace(0, 1, 9), np.ones((1, 1, 9)), error=0.0)
>>> _ = dense.through(np.ones(9))
>>> ball = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-9.81))
>>> body = ball.body("ball", mass=1, position=1, velocity=speed)
>>> _ = ball.add(PlaneImpact("floor", ball.ground, body, 0, 0, 1))
>>> ball.output("height", body.position[0], units="m")
>>> aligned = Collocation(order=1, alignment="events")
>>> bounced = uqmbd.Study("ball", ball, [0.0, 0.5, 1.0], [aligned]).run(progress=False)
>>> _ = report.event_times(bounced)
""",
    "controllers": """
>>> import numpy as np, uqmbd
>>> from uqmbd import extend
>>> from uqmbd_springs import PointForce
>>> mechanism = uqmbd.Mechanism("carts", uqmbd.Planar())
>>> cart, other = (mechanism.body(name, mass=1, inertia=1) for name in ("cart", "other"))
>>> mechanism.output("x", cart.position[0])
>>> def count(time, measured, state):
...     return -measured[:, 0], state + 1
>>> controller = uqmbd.Controller("counter", [cart.position[0]], ["force"], 100.0, count, state={"count": 0})
>>> _ = controller.state("count")
>>> _ = mechanism.add(PointForce("motor", cart, (0, 0), (controller.command("force"), 0)))
>>> _ = mechanism.add(controller)
>>> class Coupling(uqmbd.Component):
...     bodies, spaces = ("body_i", "body_j"), (uqmbd.Planar,)
...     def prepare(self):
...         return {"drawn": self.drawn_quaternion()}
...     def terms(self, p):
...         turn, term = extend.counted_angle(p, "turn", p.body_i, p.body_j, (1, 0), axis_j=(0, 0, 1))
...         yield term
...         yield uqmbd.Constraint(turn)
>>> _ = mechanism.add(Coupling("coupling", cart, other))
>>> _ = uqmbd.simulate(mechanism, [0, 0.01])
""",
    "records": """
>>> import chaospy, uqmbd
>>> from uqmbd_calibration import Bias, Calibrated, Record, Series, calibrate
>>> from uqmbd_collocation import Collocation
>>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
>>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
>>> stone = mechanism.body("stone", mass=1, velocity=speed)
>>> mechanism.output("x", stone.position[0], units="m")
>>> study = uqmbd.Study("stone", mechanism, [0.0, 0.5, 1.0])
>>> record = Record("run", [Series("x", [0.5, 1.0], [0.5, 1.0], "m", noise=0.01)])
>>> _ = record.checked_against(study)
>>> found = calibrate(study, record, surrogate=Collocation(order=2), draws=100, chains=2)
>>> _ = found.summary()
>>> _ = Calibrated(Collocation(order=1), found)
""",
}
"""Each is a text as in a docstring."""

_MADE = "uqmbd makes it from what was checked; users and plugins read its fields"
_STEPS = "integrators call it at every step, with arrays that uqmbd made"
_HOOK = "a plugin writes it and uqmbd calls it"
_SYMPY = "SymPy calls it"
_SPACE = "uqmbd calls it with coordinates of bodies"

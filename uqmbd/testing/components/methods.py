"""Test a component in complete studies: every method must give the same results for one small mechanism."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from uqmbd import plugins
from uqmbd.dynamics import Ensemble, derive, instances_of, integrate
from uqmbd.errors import AssemblyError
from uqmbd.mechanism import Component, Space, coordinates_of
from uqmbd.propagation import Propagator, Study
from uqmbd.results.chaos import surrogate_parts
from uqmbd.testing.components.cases import ComponentCase, moving_case, name_of
from uqmbd.testing.components.energy import is_timeless
from uqmbd.testing.propagators import check_schema, described, quiet, stated_errors

__all__ = ["cheap", "check_studies"]

POSES = 20
"""Maximum number of random poses in the search for a pose that can be assembled."""

LOOSE = 0.1
"""Allowed difference of two methods, relative to the standard deviation, in addition to their stated errors."""

RTOL = 1e-7


def cheap(propagator: str | Propagator) -> Propagator:
    """Return a propagator with low-cost settings; return a propagator object unchanged.

    >>> cheap("collocation").order, cheap("monte-carlo").samples
    (1, 20)
    """
    if isinstance(propagator, Propagator):
        return propagator
    kind = plugins.propagator(propagator)
    known = {f.name for f in dataclasses.fields(kind)}
    options: dict[str, Any] = {"order": 1, "verify": 2} if "order" in known else {"samples": 20}
    made: Propagator = kind(**{name: value for name, value in options.items() if name in known})
    return made


def check_studies(
    component: type[Component],
    space: type[Space],
    given: Mapping[str, Any],
    rng: np.random.Generator,
    propagators: Sequence[str | Propagator] | None = None,
    *,
    conservative: bool = True,
) -> None:
    """Run a study of a small mechanism with the component by each propagator, by default all installed ones.

    The component is attached to the ground and to one body, which moves under gravity for 0.1 s. If the component has
    only potentials and constraints that do not depend on time, the energy must be constant (`conservative`). The module
    `cases` documents other arguments. Raise AssertionError if a method fails, violates the schema, or differs from
    another method.
    """
    chosen = [cheap(p) for p in (sorted(plugins.propagators()) if propagators is None else propagators)]
    title = f"{name_of(component, space)}, in a study"
    if not chosen:
        return
    with quiet():
        study = _solvable_study(lambda: moving_case(component, space, given, rng), title, conservative=conservative)
    found = {}
    for propagator in chosen:
        what = f"{title} with {described(propagator)}"
        with quiet():
            if propagator.obstacle(study):
                continue  # the obstacle of a method is not an error of the component
            try:
                node = study.propagate(propagator)
            except Exception as error:
                raise AssertionError(f"{what}: it raised {type(error).__name__}: {error}") from error
        check_schema(node, propagator, study, what)
        assert not node.attrs["failures"], f"{what}: {node.attrs['failures']} realisations failed."
        found[what] = node
    _compare(found)


def _solvable_study(make: Callable[[], ComponentCase], title: str, *, conservative: bool) -> Study:
    """Return a study with successful assembly and motion over the whole range of its inputs."""
    reason = ""
    for _ in range(POSES):
        case = make()
        mechanism = case.mechanism
        for body in mechanism.bodies.values():
            for k, x in enumerate(body.position):
                mechanism.output(f"{body.name} {'xyz'[k]}", x, units="m")
        own = coordinates_of(case.component)
        for name, declared in () if own is None else own.declared.items():
            mechanism.output(f"coordinate {name}", case.component.coordinate(name), units=declared.units)
        if len(case.component.bodies) > 1:
            mechanism.output("force", case.component.reaction_force[0], units="N")
        study = Study("trial", mechanism, [0, 0.05, 0.1], rtol=RTOL)
        count = len(mechanism.inputs)
        ends = np.array(np.meshgrid(*[[0.001, 0.999]] * count)).reshape(count, -1).T
        try:
            ensemble = Ensemble(study.model, mechanism.inputs.from_uniform(ends))
        except AssemblyError as error:
            reason = str(error)
            continue
        trajectories = integrate(ensemble, study.times, RTOL)
        reason = next((m for m in trajectories.messages if m), "")
        if not reason:
            if conservative and _is_conservative(case):
                _check_energy(ensemble.energies(study.times, trajectories.states), title)
            return study
    raise AssertionError(
        f"{title}: the check found no random pose, out of {POSES}, that can be assembled and that moves: {reason}"
    )


def _is_conservative(case: ComponentCase) -> bool:
    derived = derive(instances_of([case.component], case.mechanism.space)[0].type)
    return is_timeless(derived) and not derived.work and not derived.events


def _check_energy(energy: np.ndarray[Any, np.dtype[np.float64]], title: str) -> None:
    """Compare the sum of kinetic and potential energy, shape (K, 2, T), with its initial value."""
    total = energy.sum(axis=1)
    change = np.abs(total - total[:, :1]).max()
    # within 1000 tolerances of the exchanged energy
    allowed = 1000 * RTOL * max(1.0, np.abs(energy).max())
    assert change < allowed, (
        f"{title}: energy is not conserved: it changes by {change:.3g} J of {np.abs(energy).max():.3g} J in 0.1 s, "
        "although the component has only time-independent potentials and constraints. If this is intended, pass "
        "conservative=False."
    )


def _compare(found: Mapping[str, Any]) -> None:
    """Compare each method with the first method that makes a surrogate, otherwise with the first method."""
    if len(found) < 2:
        return
    first = next((what for what, node in found.items() if surrogate_parts(node)), next(iter(found)))
    reference = found[first].children["statistics"].to_dataset()
    scale = reference["std"].max("time").values[:, None]
    known = stated_errors(found[first])
    for what, node in found.items():
        statistics, errors = node.children["statistics"].to_dataset(), stated_errors(node)
        for k, name in enumerate(("mean", "std")):
            if name == "std" and not surrogate_parts(node) and "std_error_std" not in statistics:
                continue  # the method states no error, and may state no standard deviation
            a, b = statistics[name].values, reference[name].values
            size = np.abs(reference["mean"]).max("time").values[:, None]
            allowed = LOOSE * scale + errors[k] + known[k] + 100 * RTOL * (1 + size)
            error = np.abs(a - b)
            worst = np.unravel_index(int(np.argmax(error / allowed)), error.shape)
            assert error[worst] <= allowed[worst], (
                f"{what}: the {name} of {str(reference['output'].values[worst[0]])!r} at "
                f"{reference['time'].values[worst[1]]:g} s is {a[worst]:.6g}; the reference method "
                f"{first.rpartition(' with ')[2]} gives {b[worst]:.6g}. The difference {error[worst]:.2g} exceeds "
                f"the allowed {allowed[worst]:.2g}."
            )

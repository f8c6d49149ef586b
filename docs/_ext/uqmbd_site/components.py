"""Pages of components: a picture of one in a mechanism, and its equations, from what the class declares and states."""

from __future__ import annotations

import inspect
import textwrap
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any, TypeAlias

import sympy

import uqmbd

__all__ = ["component_page", "draw", "equations", "example_code", "example_of", "with_named_parts"]

Line: TypeAlias = list[Any]
"""An equation: texts, and expressions of SymPy."""

LONGEST = 500
"""Characters of LaTeX of one equation; where one is longer, the parts that equations share have names."""

WIDEST = 150
"""Characters of LaTeX of one row; a sum that is longer takes several."""

FEWEST = (24, 12, 6)
"""Operations that the name of a part saves, at least: the first number with which no equation is too long."""

WIDTH = 88
"""Characters of a line of an example."""

PLACES = {"at": ((0.5, 0), (-0.5, 0)), "apart": ((0, 0), (-0.4, 0.1))}
"""Points of body i and body j: where joints are, and where what has a length ends."""


def example_of(component: type[uqmbd.Component]) -> tuple[uqmbd.Mechanism, uqmbd.Component]:
    """Return a component between two bodies (in the plane where it can be), with a value for whatever it declares."""
    space = _space(component)()
    mechanism = uqmbd.Mechanism(component.__name__, space)
    bodies: dict[str, Any] = {}
    for role, given in _bodies(component).items():
        body = bodies[role] = mechanism.body(role, **given)
        if space.turns:
            for n, end in enumerate((-0.5, 0.5)):
                mechanism.output(f"{role}_{n}", body.point((end, *[0] * (space.dimension - 1)))[0], units="m")
    made = component("component", **bodies, **_values(component))
    return mechanism, mechanism.add(made)


def example_code(component: type[uqmbd.Component]) -> str:
    """Return Python code that adds a component to a mechanism of one or two bodies."""
    values, bodies = _values(component), _bodies(component)
    laws = [value for value in values.values() if isinstance(value, sympy.Expr)]
    symbols = {str(symbol) for law in laws for symbol in law.free_symbols}
    functions = {type(part).__name__ for law in laws for part in law.atoms(sympy.Function)}
    functions |= {"pi" for law in laws if law.has(sympy.pi)}
    lines = [f"from sympy import {', '.join(sorted(functions))}", ""] if functions else []
    lines += ["import uqmbd"]
    lines += [
        f"from {component.__module__.partition('.')[0]} import {', '.join([component.__name__, *sorted(symbols)])}"
    ]
    lines += ["", f'mechanism = uqmbd.Mechanism("example", uqmbd.{_space(component).__name__}())']
    for role, given in bodies.items():
        lines += [f"{role} = mechanism.body({', '.join([repr(role), *_arguments(given)])})".replace("'", '"')]
    arguments = ['"component"', *(f"{role}={role}" for role in bodies), *_arguments(values)]
    whole = f"mechanism.add({component.__name__}({', '.join(arguments)}))"
    rows = ["mechanism.add(", f"    {component.__name__}(", *(f"        {x}," for x in arguments), "    )", ")"]
    return "\n".join(lines + ([whole] if len(whole) <= WIDTH else rows))


def _arguments(given: dict[str, Any]) -> list[str]:
    """Write keyword arguments."""
    return [
        f"{key}={sympy.sstr(value) if isinstance(value, sympy.Expr) else repr(value)}".replace("'", '"')
        for key, value in given.items()
    ]


def _space(component: type[uqmbd.Component]) -> Any:
    """Return the space of the example: the plane, where the component supports it."""
    return uqmbd.Planar if uqmbd.Planar in component.spaces else component.spaces[0]


def _bodies(component: type[uqmbd.Component]) -> dict[str, dict[str, Any]]:
    """Return the arguments of the bodies of the example, by role."""
    space = _space(component)()
    pose = (1, 0) if "at" in component.drawn_by or component.symbol == "contact" else (1, 0.2)
    turning: dict[str, Any] = {"inertia": 0.1 if space.dimension == 2 else (0.1, 0.1, 0.1)} if space.turns else {}
    found = {}
    for k, role in enumerate(component.bodies):
        place = [0, 0, 0] if k == 0 and len(component.bodies) > 1 else [*pose, 0]
        found[role] = {"mass": 1, "position": place[: space.dimension], **turning}
    return found


def _values(component: type[uqmbd.Component]) -> dict[str, Any]:
    """Return the values of the parameters of the example."""
    space = _space(component)()
    declared = {key: p for key, p in component.parameters().items() if p.fits(space)}
    return {key: value for key, p in declared.items() if (value := _value(component, key, p, space)) is not None}


def _value(component: type[uqmbd.Component], key: str, p: uqmbd.Parameter[Any], space: Any) -> Any:
    """Return a value of a parameter; None: it is left out."""
    rest = [0] * (space.dimension - 2)
    if p.example is not None:
        return p.example
    if p.kind == "point":
        points = PLACES["at" if "at" in component.drawn_by else "apart"]
        last = component.body_of(key) == component.bodies[-1]
        return [*points[last], *rest]
    if p.kind in ("axis", "turning_axis"):
        flat = p.kind == "axis" and space.dimension == 2
        normal = key.startswith("normal")
        return (0, 1) if flat and normal else (1, 0) if flat else (0, 0, 1) if space.dimension == 3 else None
    if p.kind == "vector" and p.required:
        return [1, -1, *rest]
    if p.kind == "moment" and p.required:
        return 1 if space.dimension == 2 else (0, 0, 1)
    if p.kind == "option":
        return p.words[0] if p.required and p.words else None
    if p.kind == "scalar":
        low = max(p.minimum, 0.0)
        return min(low + 0.3, p.maximum)
    return None


def draw(component: type[uqmbd.Component], path: Path) -> None:
    """Draw a component between two bodies, as the report draws mechanisms."""
    import matplotlib.pyplot as plt

    mechanism, _ = example_of(component)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        figure = uqmbd.report.mechanism(mechanism)
    figure.savefig(path, bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)


class _Shown(uqmbd.extend.Frame):
    """A body whose points, directions and turns have symbols of their own, for equations that people read."""

    def __init__(self, space: Any, letter: str, names: dict[tuple[Any, ...], str]) -> None:
        super().__init__(space)
        self.letter, self.names, self.is_ground = letter, names, False

    def _symbols(self, head: str, below: str, ends: Sequence[str] = ()) -> sympy.Matrix:
        """Symbols of one head with what stands below, by default for each axis."""
        below = below if len(below) == 1 else rf"\mathrm{{{below}}}"
        between = "," if len(below) > 1 else ""
        axes = [f"{between}{end}" if end else "" for end in (ends or "xyz"[: self.space.dimension])]
        return sympy.Matrix([sympy.Symbol(f"{head}_{{{below}{axis}}}", real=True) for axis in axes])

    def _of(self, local: Any) -> str:
        found = self.names.get(tuple(local))
        return self.letter if found is None else found

    @property
    def position(self) -> sympy.Matrix:
        return self._symbols("o", self.letter)

    @property
    def velocity(self) -> sympy.Matrix:
        return self._symbols(r"\dot o", self.letter)

    @property
    def quaternion(self) -> sympy.Matrix:
        size = self.space.size - self.space.dimension
        return self._symbols("e", self.letter, [str(k) for k in range(size)])

    @property
    def rotation(self) -> sympy.Matrix:
        d = self.space.dimension
        comma = "," if len(self.letter) == 1 else ""
        entries = [f"{comma}{m}{n}" for m in range(1, d + 1) for n in range(1, d + 1)]
        return sympy.Matrix(d, d, list(self._symbols("A", self.letter, entries)))

    @property
    def angular_velocity(self) -> sympy.Matrix:
        if self.space.dimension == 2:
            return self._symbols(r"\omega", self.letter, [""])
        return self._symbols(r"\omega", self.letter)

    body_angular_velocity = angular_velocity

    def point(self, local: Any) -> sympy.Matrix:
        return self._symbols("r", self._of(local))

    def point_velocity(self, local: Any) -> sympy.Matrix:
        return self._symbols(r"\dot r", self._of(local))

    def direction(self, local: Any) -> sympy.Matrix:
        return self._symbols("a", self._of(local))

    def attitude(self, local: Any) -> tuple[sympy.Expr, ...]:
        return tuple(self.quaternion)


def equations(component: type[uqmbd.Component]) -> list[str]:
    """Return in LaTeX what a component states: energies, virtual work, constraints, events."""
    mechanism, made = example_of(component)
    space = mechanism.space
    values, names = {}, {}
    for key, value in made.values.items():
        letter = key.rsplit("_", 1)[-1] if key.rsplit("_", 1)[-1] in ("i", "j") else key
        if isinstance(value, (tuple, list, sympy.MatrixBase)) and len(value):
            axes = "xyz" if len(value) < 4 else "0123456789"
            head = _latex_name(key, bare=True)
            values[key] = tuple(sympy.Symbol(f"{head}_{{{axes[n % 10]}}}", real=True) for n in range(len(value)))
            names[values[key]] = letter
        elif value is not None and key in component.parameters() and component.parameters()[key].kind != "option":
            values[key] = sympy.Symbol(_latex_name(key), real=True) if value != () else value
        else:
            values[key] = value
    ends = [role.rsplit("_", 1)[-1] if role.rsplit("_", 1)[-1] in ("i", "j") else role for role in component.bodies]
    frames = {role: _Shown(space, end, names) for role, end in zip(component.bodies, ends, strict=True)}
    own = {} if made.coordinate_set is None else made.coordinate_set.pairs
    pairs = {
        name: (sympy.Symbol(f"q_{{{k}}}", real=True), sympy.Symbol(rf"\dot{{q}}_{{{k}}}", real=True))
        for k, name in enumerate(own, 1)
    }
    local = uqmbd.extend.Local(space, frames, values, uqmbd.t, pairs)
    terms, _ = made.stated(local)
    spoken: dict[Any, str] = {symbol: rf"\mathrm{{{_words(name)}}}" for name, symbol in local.states.items()}
    for symbol, (kind, expression) in local.quantities.items():
        spoken[symbol] = _rate(expression, spoken) if kind == "rate" else _named(symbol, local)
    lines = [line for term in terms for line in _lines(term)]
    used = {x for line in lines for e in line if not isinstance(e, str) for x in e.free_symbols}
    needed = _needed(used, local)
    lines += [[f"{spoken[x]} =", e] for x, (kind, e) in local.quantities.items() if kind == "value" and x in needed]
    whole = lines
    for fewest in FEWEST:
        long = [k for k, line in enumerate(lines) if len(_row(line, spoken)) > LONGEST]
        if not long:
            break
        long = [k for k, line in enumerate(whole) if len(_row(line, spoken)) > LONGEST]
        parts, shortened = with_named_parts([whole[k] for k in long], fewest)
        by_number = dict(zip(long, shortened, strict=True))
        lines = [by_number.get(k, line) for k, line in enumerate(whole)]
        lines += [[f"{name} =", e] for name, e in parts.items()]
    return [_rows(line, spoken) for line in lines]


def with_named_parts(lines: Sequence[Line], fewest: int) -> tuple[dict[sympy.Symbol, sympy.Expr], list[Line]]:
    """Give names, u with a number, to what equations hold more than once; return what they are, and the equations.

    What saves fewer operations by a name stays where it is.
    """
    found = [e for line in lines for e in line if not isinstance(e, str)]
    parts, shared = sympy.cse(found, symbols=(sympy.Symbol(f"u_{{{k}}}", real=True) for k in count(1)), order="none")
    while True:
        uses = Counter(x for e in (*shared, *(e for _, e in parts)) for x in _leaves(e))
        plain = next(((x, e) for x, e in parts if uses[x] < 2 or uses[x] * e.count_ops() < fewest), None)
        if plain is None:
            break
        parts = [(name, e.xreplace(dict([plain]))) for name, e in parts if name != plain[0]]
        shared = [e.xreplace(dict([plain])) for e in shared]
    numbers = {name: sympy.Symbol(f"u_{{{k}}}", real=True) for k, (name, _) in enumerate(parts, 1)}
    values = iter([e.xreplace(numbers) for e in shared])
    named = [[x if isinstance(x, str) else next(values) for x in line] for line in lines]
    return {numbers[name]: e.xreplace(numbers) for name, e in parts}, named


def _leaves(expression: sympy.Expr) -> Iterator[sympy.Basic]:
    return (x for x in sympy.preorder_traversal(expression) if x.is_Symbol)


def _row(line: Line, spoken: dict[Any, str]) -> str:
    return " ".join(x if isinstance(x, str) else _latex(x, spoken) for x in line)


def _rows(line: Line, spoken: dict[Any, str]) -> str:
    """Return the LaTeX of an equation; of a long sum a row for as many terms as it holds."""
    text, last = _row(line, spoken), line[-1]
    if len(text) <= WIDEST or isinstance(last, str) or not last.is_Add:
        return text
    head = _row(line[:-1], spoken)
    rows = [""] if len(head) < WIDEST // 2 else ["", ""]
    for k, term in enumerate(last.args):
        shown = _latex(term, spoken)
        shown = shown if not k or shown.startswith("-") else f"+ {shown}"
        if rows[-1] and len(rows[-1]) + len(shown) > WIDEST:
            rows.append("")
        rows[-1] += f" {shown}"
    if len(rows) == 1:
        return text
    # empty groups: relations and signs at the ends of rows have the space beside them that they have within
    return rf"{head} {{}}&{rows[0]}" + "".join(rf" \\ &\quad {{}}{row}" for row in rows[1:])


def _needed(used: set[Any], local: uqmbd.extend.Local) -> set[Any]:
    """Return the named quantities that terms hold, themselves or in others."""
    found, todo = set(), [x for x in used if x in local.quantities]
    while todo:
        symbol = todo.pop()
        if symbol not in found:
            found.add(symbol)
            todo += [x for x in local.quantities[symbol][1].free_symbols if x in local.quantities]
    return found


def _named(symbol: Any, local: uqmbd.extend.Local) -> str:
    """Return the name of a quantity, with an axis where several are entries of one vector."""
    same = [x for x, (kind, _) in local.quantities.items() if x.name == symbol.name and kind == "value"]
    below = f"_{{{'xyz'[same.index(symbol) % 3]}}}" if len(same) > 1 else ""
    return rf"\mathrm{{{_words(symbol.name)}}}{below}"


def _rate(expression: Any, spoken: dict[Any, str]) -> str:
    text = _latex(expression, spoken)
    return rf"\dot{{{text}}}" if expression.is_Symbol else rf"\frac{{\mathrm d}}{{\mathrm dt}}\left({text}\right)"


def _latex(expression: Any, spoken: dict[Any, str]) -> str:
    return str(sympy.latex(expression, symbol_names=spoken, order="none", mul_symbol=r"\,"))


def _words(name: str) -> str:
    return name.replace("_", " ").replace(" ", "~")


def _latex_name(key: str, *, bare: bool = False) -> str:
    head, _, end = key.rpartition("_")
    below = end in ("i", "j") and not bare
    return rf"\mathrm{{{_words(head)}}}_{{{end}}}" if below else rf"\mathrm{{{_words(key)}}}"


def _lines(term: Any) -> Iterator[Line]:
    """Yield the equations of a term, each as texts and expressions in their order."""
    match term:
        case uqmbd.Kinetic(energy=energy):
            yield ["T =", sympy.sympify(energy)]
        case uqmbd.Potential(energy=energy):
            yield ["V =", sympy.sympify(energy)]
        case uqmbd.VirtualWork(force=force, velocity=velocity):
            for f, v in zip(_column(force), _column(velocity), strict=True):
                if f != 0:
                    yield [r"\dot s =", v, r":\quad F =", f]
        case uqmbd.Constraint(equations=found) | uqmbd.extend.VelocityConstraint(equations=found):
            for e in _column(found):
                yield ["0 =", e]
        case uqmbd.Auxiliary(state=state, rate=rate):
            yield [r"\frac{\mathrm d}{\mathrm dt}\,", state, "=", sympy.sympify(rate)]
        case uqmbd.Event(guard=guard, jump=uqmbd.extend.Impact(speed=speed, restitution=restitution)):
            yield ["g =", sympy.sympify(guard)]
            yield [r"\dot g =", sympy.sympify(speed), r",\quad \dot g^+ / \dot g^- =", -sympy.sympify(restitution)]


def _column(found: Any) -> list[Any]:
    if isinstance(found, sympy.MatrixBase):
        return list(found)
    return [sympy.sympify(x) for x in found] if isinstance(found, (list, tuple)) else [sympy.sympify(found)]


def component_page(component: type[uqmbd.Component], image: str) -> list[str]:
    """Return what the page of a component has beside its docstring: picture, spaces, equations, statement."""
    spaces = ", ".join(f"`uqmbd.{space.__name__}`" for space in component.spaces)
    shown = uqmbd.Planar if uqmbd.Planar in component.spaces else component.spaces[0]
    lines = ["", "Figure", "------", "", f".. figure:: {image}", "   :width: 100%"]
    lines += [f"   :alt: {component.__name__} between two bodies", ""]
    lines += [f"Spaces: {spaces}.", "", "Equations", "---------", ""]
    if found := equations(component):
        lines += [f"In `uqmbd.{shown.__name__}`, in :ref:`symbols of points, axes and turns <symbols>`:", ""]
        for line in found:
            lines += [".. math::", "", f"   {line}", ""]
    lines += ["Example", "-------", "", ".. code-block:: python", ""]
    lines += [*(f"   {line}".rstrip() for line in example_code(component).splitlines()), ""]
    source = textwrap.dedent(inspect.getsource(component.terms))
    lines += ["The terms as the component states them, from which the equations of motion are derived:", ""]
    lines += [".. code-block:: python", "", *(f"   {line}".rstrip() for line in source.splitlines()), ""]
    return lines

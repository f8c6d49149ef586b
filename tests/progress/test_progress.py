"""What is told of progress: whole tables, totals that are maxima, lines while nothing tells of itself."""

from __future__ import annotations

import io
import re
import warnings
from collections import Counter

import chaospy
import numpy as np
import pytest
from rich.console import Console

import uqmbd
from uqmbd.progress import Board, Lines, expected, failed
from uqmbd.wording import format_duration
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo


def shown(board, now, width):
    console = Console(
        file=io.StringIO(), width=width, height=50, force_terminal=True, no_color=True, legacy_windows=False
    )
    console.print(board.table(now, width))
    return [line.rstrip() for line in re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue()).splitlines()]


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_a_row_for_each_method_and_one_for_all_fit_any_width(width):
    board = Board()
    board.stage("loading", 0.0)
    board.settle(2.0)
    board.expect(
        {"monte-carlo": 500, "a method with a label that is much too long": uqmbd.extend.AtMost(5000), "last": 16}
    )
    board.begun("monte-carlo", 500, 2.0)
    board.moved("monte-carlo", 125)
    lines = shown(board, 4.0, width)
    assert len(lines) == 5 and all(len(line) <= width for line in lines)
    assert lines[0].startswith("loading") and lines[-1].startswith("all methods")
    if width >= 60:
        assert "125 of 500" in lines[1] and "2 s, 6 s left" in lines[1]
        assert "waiting" in lines[2] and "125 of at most 5516" in lines[-1]


def test_what_ended_early_counts_what_there_was():
    """500, 1531 of at most 5000, and 7 of 16 before a failure are 2038 of 2038."""
    board = Board()
    board.expect({"a": 500, "b": uqmbd.extend.AtMost(5000), "c": 16, "unfit": None})
    board.ended("unfit", "failed", 0.0)
    for label, total, done, state in (
        ("a", 500, 500, "done"),
        ("b", uqmbd.extend.AtMost(5000), 1531, "done"),
        ("c", 16, 7, "failed"),
    ):
        board.begun(label, total, 0.0)
        board.moved(label, done)
        board.ended(label, state, 1.0)
    whole = board.whole()
    assert (whole.done, whole.total, whole.at_most, whole.state) == (2038, 2038, False, "failed")


def test_methods_that_do_not_tell_are_counted_as_methods():
    board = Board()
    board.expect({"a": 500, "b": None})
    board.begun("a", 500, 0.0)
    board.ended("a", "done", 1.0)
    assert board.whole().count() == "1 of 2" and "methods" in shown(board, 2.0, 80)[-1]


def test_lines_come_while_nothing_tells_of_itself():
    """A stage of 10 s that says nothing is never silent for more than two seconds."""
    now, screen = [0.0], io.StringIO()
    lines = Lines(screen, clock=lambda: now[0])
    lines.stage("loading")
    written = [0.0]
    for step in range(1, 51):
        now[0] = 0.2 * step
        before = len(screen.getvalue())
        lines.beat()
        if len(screen.getvalue()) > before:
            written.append(now[0])
    gaps = [b - a for a, b in zip(written, [*written[1:], 10.0], strict=True)]
    assert max(gaps) <= 2.0 and len(written) <= 7
    assert screen.getvalue().splitlines()[:2] == ["loading ...", "loading ... 1.8 s"]


def test_a_long_run_has_few_lines():
    now, screen = [0.0], io.StringIO()
    lines = Lines(screen, clock=lambda: now[0])
    lines.start("long", 86_400)
    for _ in range(86_400):
        now[0] += 1.0
        lines.advance("long")
    assert 20 < len(screen.getvalue().splitlines()) < 200


def test_who_knows_nothing_of_it_is_reported_nothing_of_it():
    class Plain:
        def start(self, label, total):
            self.total = total

    plain = Plain()
    for tell, given in ((expected, {"a": 3}), (failed, "a")):
        tell(plain, given)
    plain.start("a", uqmbd.extend.AtMost(5))
    assert plain.total == 5 and plain.total + 1 == 6


def test_a_study_announces_its_methods_and_tells_of_failures():
    """Expected before the first begins; what fails is told, with its label."""
    told = []

    class All:
        def __getattr__(self, name):
            return lambda *given: told.append((name, *given))

    class Broken(uqmbd.extend.Propagator):
        name = "broken"

        def propagate(self, problem):
            raise ValueError("no")

    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.05), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=2, inertia=2.0 * length**2, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("tip", rod.point((length / 2, 0))[1], units="m")
    study = uqmbd.Study("s", mechanism, [0, 0.1], [MonteCarlo(samples=4, seed=1), Broken()])
    with pytest.warns(uqmbd.MethodFailedWarning):
        study.run(progress=All())
    assert told[0] == ("expect", {"monte-carlo": 4, "broken": None})
    assert ("start", "monte-carlo", 4) in told and told[-1] == ("fail", "broken")


def test_no_time_is_reported_to_be_left_while_work_goes_on_after_its_last_realisation():
    now, screen = [0.0], io.StringIO()
    lines = Lines(screen, clock=lambda: now[0])
    lines.start("aligned", 48)
    lines.advance("aligned", 48)
    now[0] = 10.0
    lines.beat()
    assert screen.getvalue().splitlines()[-1] == "aligned: 48 of 48, evaluating ... 10 s"
    assert lines.board.works["aligned"].clock(10.0) == "10 s"


class Counted:
    """Receiver that counts what is announced, begun and done, by label."""

    def __init__(self):
        self.announced, self.begun, self.done = {}, Counter(), Counter()

    def expect(self, totals):
        self.announced = dict(totals)

    def start(self, label, total):
        self.begun[label] += total

    def advance(self, label, count=1):
        self.done[label] += count

    def finish(self, label):
        pass


def swinging(outputs, scalars, requirements):
    """A pendulum of random length, with outputs over time, without a time, or requirements."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.48, 0.52), units="m")
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(length, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length, 0)))
    if outputs:
        mechanism.output("height", rod.position[1], units="m")
    if scalars:
        mechanism.output("lowest", uqmbd.minimum(rod.position[1]), units="m")
    if requirements:
        mechanism.require("deep", rod.position[1] >= -0.51)
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize(
    "kinds", [(True, False, False), (True, True, True), (False, True, False), (False, False, True)]
)
def test_what_is_announced_is_what_is_done(kinds):
    """Announced, begun, reported as done, and stored with the results: the same number, or not above a maximum."""
    adaptive = {"elements": "adaptive", "max_elements": 4, "threshold": 1e-9}
    methods = [MonteCarlo(samples=20, seed=1)]
    methods += [kind(order=2, label=kind.__name__) for kind in (Collocation, Galerkin)]
    for elements in ({"elements": 2}, {"elements": 3}, adaptive):
        name = elements["elements"]
        methods += [kind(order=2, label=f"{kind.__name__} {name}", **elements) for kind in (Collocation, Galerkin)]
    seen = Counted()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the threshold is not met
        tree = uqmbd.Study("s", swinging(*kinds), np.linspace(0, 1, 11), methods).run(progress=seen)
    assert len(seen.announced) == len(methods) == 9
    for label, announced in seen.announced.items():
        done = tree.children[label].attrs["realisations"]
        assert seen.done[label] == done > 0
        assert (
            done <= announced if isinstance(announced, uqmbd.extend.AtMost) else done == announced == seen.begun[label]
        )


@pytest.mark.parametrize("parts", [(32,), (16, 16), (16, 8, 8), (16,), (40,)])
def test_parts_of_a_method_add_up_to_what_was_announced(parts):
    """The table begins with the announced number, grows beyond it only if more is begun, and ends at what was done."""
    board = Board()
    board.expect({"a": 32, "b": 5})
    for k, part in enumerate(parts):
        work = board.begun("a", part, float(k))
        assert work.total == max(32, sum(parts[: k + 1]))
        board.moved("a", part)
    board.ended("a", "done", 9.0)
    assert board.works["a"].count() == str(sum(parts)) and board.works["a"].begin == 0.0
    assert board.whole().total == sum(parts) + 5 and board.whole().done == sum(parts)


@pytest.mark.parametrize("kinds", [(True, True, True), (False, False, True)])
def test_the_last_line_states_the_wall_time_of_the_results(kinds):
    """It is that of outputs, scalar outputs and requirements, with what is computed from them; each method ends once."""
    methods = [MonteCarlo(samples=20, seed=1), Collocation(order=2)]
    stream = io.StringIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        tree = uqmbd.Study("s", swinging(*kinds), np.linspace(0, 1, 11), methods).run(progress=Lines(stream))
    for method in methods:
        label = method.node_name
        (said,) = re.findall(rf"^{label}: done after ([0-9.]+ s)", stream.getvalue(), re.MULTILINE)
        assert said == format_duration(tree.children[label].attrs["wall_time"], rough=True)
    stated = [0.0, 0.0]
    for k, seconds in enumerate((3.0, None)):
        board = Board()
        board.begun("a", 4, 1.0)
        if seconds is not None:
            board.costs("a", seconds)
        board.costs("unknown", 1.0)
        board.ended("a", "done", 2.0)
        stated[k] = board.works["a"].spent(9.0)
    assert stated == [3.0, 1.0]

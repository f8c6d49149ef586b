"""What tests of the dynamics share: models whose evaluators are watched."""

from __future__ import annotations

from dataclasses import replace

import pytest

from uqmbd.dynamics.equations.evaluators import Evaluators


class Watched:
    """An evaluator that reports the number of realisations of each call."""

    def __init__(self, evaluator, report):
        self.evaluator, self.report = evaluator, report

    def __call__(self, arguments, parameters):
        """Evaluate as before."""
        self.report(len(arguments))
        return self.evaluator(arguments, parameters)

    def __getattr__(self, name):
        return getattr(self.evaluator, name)


@pytest.fixture
def watched_evaluator():
    """Return a model whose evaluator of one kind reports its calls, by the number of realisations."""

    def watched(model, kind, report):
        found = model.evaluators
        return replace(model, evaluators=Evaluators({**found.made, kind: Watched(found[kind], report)}, found.later))

    return watched

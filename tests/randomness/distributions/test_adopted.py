"""Distributions of scipy.stats and OpenTURNS are taken as chaospy's are: every number is compared with their package."""

from __future__ import annotations

import subprocess
import sys

import chaospy
import cloudpickle
import hypothesis
import numpy as np
import pytest
import scipy.stats
from hypothesis import strategies as st
from scipy.special import erfinv, ndtri

import uqmbd
import uqmbd.progress
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.randomness.distributions import AffineDistribution
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from ...mechanisms import oscillator

LEVELS = np.linspace(1e-4, 1 - 1e-4, 101)

# shapes and how they are drawn; loc and scale are added to each
NUMBER = st.floats(0.6, 4.0)
SHAPES = {
    "norm": [], "uniform": [], "expon": [], "gamma": [NUMBER], "beta": [NUMBER, NUMBER], "chi2": [NUMBER], "arcsine": [],
    "lognorm": [st.floats(0.05, 0.6)], "weibull_min": [NUMBER], "gumbel_r": [], "gumbel_l": [], "logistic": [],
    "laplace": [], "triang": [st.floats(0.1, 0.9)], "halfnorm": [], "rayleigh": [], "maxwell": [], "cosine": [],
    "t": [st.floats(6, 60)], "johnsonsu": [st.floats(-1, 1), st.floats(1.5, 3)], "gompertz": [NUMBER],
    "genpareto": [st.floats(-0.5, -0.1)], "invgauss": [st.floats(0.2, 2.0)], "powerlaw": [st.floats(1.0, 4.0)],
    "semicircular": [], "truncnorm": [st.floats(-3, -0.5), st.floats(0.5, 3)], "loguniform": [st.floats(0.1, 1.0), st.floats(2.0, 9.0)],
}  # fmt: skip
CLASSICAL = {"norm": "hermite", "lognorm": "hermite", "uniform": "legendre", "arcsine": "jacobi", "beta": "jacobi", "expon": "laguerre", "gamma": "laguerre", "chi2": "laguerre"}  # fmt: skip


@st.composite
def frozen(draw):
    name = draw(st.sampled_from(sorted(SHAPES)))
    shapes = [draw(s) for s in SHAPES[name]]
    return name, getattr(scipy.stats, name)(*shapes, loc=draw(st.floats(-50, 50)), scale=draw(st.floats(0.01, 20)))


def holds(distribution, ppf, cdf, mean, std, bounds, accuracy=1e-7):
    """Samples, germs, Gauss rules, transformations, moments, bounds, and all of it after storing."""
    variable = uqmbd.RandomVariable("x", distribution)
    joint = JointInput.of([variable])
    space = GermSpace.of(joint)
    spread = float(np.subtract(*ppf(np.array([0.95, 0.05]))))
    quantiles = ppf(LEVELS)
    assert isinstance(variable.distribution, chaospy.Distribution)
    assert variable.mean == pytest.approx(mean, abs=1e-8 * spread)
    assert np.abs(joint.from_uniform(LEVELS[:, None])[:, 0] - quantiles).max() < 1e-9 * spread
    law = AffineDistribution.of(variable.distribution)
    assert np.abs(law.cdf(quantiles) - cdf(quantiles)).max() < 1e-9
    at = space.from_uniform(LEVELS[:, None])
    assert np.abs(space.to_inputs(at)[:, 0] - quantiles).max() < accuracy * spread
    assert np.abs(space.to_germs(space.to_inputs(at)) - at).max() < 1e-6
    nodes, weights = space.germs[0].gauss(10)
    inputs = space.to_inputs(nodes[:, None])[:, 0]
    low, high = bounds
    assert np.all((inputs >= low - 1e-12 * abs(low)) & (inputs <= high + 1e-12 * abs(high)))
    assert weights @ inputs == pytest.approx(mean, abs=1e-6 * spread)
    assert np.sqrt(weights @ (inputs - weights @ inputs) ** 2) == pytest.approx(std, rel=1e-4)
    stored = space.to_dataset()
    assert all(array.dtype.kind in "fiU" for array in stored.variables.values())  # tables and names: nothing to execute
    assert np.array_equal(GermSpace.from_dataset(stored).to_inputs(at), space.to_inputs(at))
    sent = cloudpickle.loads(cloudpickle.dumps(joint))
    assert np.array_equal(sent.from_uniform(LEVELS[:, None]), joint.from_uniform(LEVELS[:, None]))
    return space


@pytest.mark.thorough
@hypothesis.settings(max_examples=40, deadline=None, derandomize=True)
@hypothesis.given(frozen())
def test_frozen_distributions_of_scipy(case):
    name, distribution = case
    with np.errstate(all="ignore"):
        space = holds(
            distribution,
            distribution.ppf,
            distribution.cdf,
            distribution.mean(),
            distribution.std(),
            distribution.support(),
        )
    if name in CLASSICAL:
        assert space.germs[0].family == CLASSICAL[name]
        assert "scipy" not in str(uqmbd.RandomVariable("x", distribution).distribution)


# their quantiles, formulas of scipy, take seconds; of the next to last the density does, too, and of the last the infinite
# third moment is not seen in its tail
SLOW = {
    "ksone", "kstwo", "ncf", "nct", "ncx2", "powerlognorm", "rice", "skewnorm", "tukeylambda", "wald", "landau", "pearson3",
    "kstwobign", "trapezoid", "dpareto_lognorm", "levy_stable", "studentized_range", "rel_breitwigner",
}  # fmt: skip
# scipy integrates and searches with errors of about 1e-9
ROUGH = {"geninvgauss", "norminvgauss", "gausshyper", "vonmises"}


def all_of_scipy():
    from scipy.stats._distr_params import distcont

    found = {name: shapes for name, shapes in distcont if isinstance(name, str)}
    # scipy's own example is at the edge of what has a kurtosis
    return {name: shapes for name, shapes in found.items() if name not in SLOW} | {"invgamma": (5.0,)}


@pytest.mark.thorough
@pytest.mark.parametrize("name", all_of_scipy())
def test_every_family_of_scipy_with_quick_quantiles(name):
    """Those without finite moments are refused by the methods that need them, and sampled as they are."""
    given = getattr(scipy.stats, name)(*all_of_scipy()[name], loc=1.5, scale=0.7)
    joint = JointInput.of([uqmbd.RandomVariable("x", given)])
    quantiles = given.ppf(LEVELS)
    slack = (1e-8 if name in ROUGH else 1e-9) * np.ptp(quantiles)
    assert np.abs(joint.from_uniform(LEVELS[:, None])[:, 0] - quantiles).max() < slack
    with np.errstate(all="ignore"):
        if not np.isfinite(given.moment(4)):
            with pytest.raises(uqmbd.StudyError, match="infinite"):
                GermSpace.of(joint)
            return
        space = GermSpace.of(joint)
        found = space.to_inputs(space.from_uniform(LEVELS[:, None]))[:, 0]
        assert np.abs(found - quantiles).max() < 1e-7 * np.ptp(quantiles)
        assert joint.means[0] == pytest.approx(given.mean(), abs=1e-9 * given.std())


FAR = np.array([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.5, 0.9, 1 - 1e-3, 1 - 1e-6, 1 - 2.0**-30, 1 - 2.0**-45])
# written so that nothing cancels at either end
SAME = {
    "half normal": (scipy.stats.foldnorm(0.0), np.where(FAR < 0.5, np.sqrt(2) * erfinv(FAR), -ndtri((1 - FAR) / 2))),
    "half Cauchy": (scipy.stats.foldcauchy(0.0), np.where(FAR < 0.5, np.tan(np.pi / 2 * FAR), 1 / np.tan(np.pi / 2 * (1 - FAR)))),
    "inverse Gaussian": (scipy.stats.geninvgauss(-0.5, 2.0, scale=0.5), scipy.stats.invgauss(0.5).ppf(FAR)),
    "reciprocal": (scipy.stats.recipinvgauss(0.5), 1 / scipy.stats.invgauss(0.5).isf(FAR)),
    "uniform": (scipy.stats.irwinhall(1), FAR),
    "triangle": (scipy.stats.irwinhall(2), np.where(FAR < 0.5, np.sqrt(2 * FAR), 2 - np.sqrt(2 * (1 - FAR)))),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_quantiles_by_the_density_are_those_of_a_formula(name):
    """Families of which scipy has a density only, with parameters at which they are another one that has a formula."""
    given, expected = SAME[name]
    found = JointInput.of([uqmbd.RandomVariable("x", given)]).from_uniform(FAR[:, None])[:, 0]
    assert np.abs(found / expected - 1).max() < 1e-11


@pytest.mark.thorough
def test_a_quantile_by_the_density_does_not_hang_on_others():
    joint = JointInput.of([uqmbd.RandomVariable("x", scipy.stats.argus(2.0, loc=3.0))])
    at = np.random.default_rng(1).uniform(size=(257, 1))
    together = joint.from_uniform(at)
    assert np.array_equal(together, np.concatenate([joint.from_uniform(part) for part in np.array_split(at, 40)]))


def test_a_density_that_is_wrong_gives_no_table():
    """Quantiles are then those that scipy searches for: of the distribution function, here of a normal variable."""

    class Wrong(scipy.stats.rv_continuous):
        def _pdf(self, x):
            return 1.1 * scipy.stats.norm.pdf(x)

        def _cdf(self, x):
            return scipy.stats.norm.cdf(x)

    joint = JointInput.of([uqmbd.RandomVariable("x", Wrong(name="wrong")())])
    assert np.abs(joint.from_uniform(LEVELS[:5, None])[:, 0] - ndtri(LEVELS[:5])).max() < 1e-9


@pytest.mark.thorough
def test_a_study_tells_that_it_makes_tables():
    told = []

    class Told(uqmbd.progress.Silent):
        def stage(self, text):
            told.append(text)

    for distribution in (scipy.stats.argus(2.0, 90, 20), scipy.stats.norm(100, 3)):
        mechanism = oscillator(uqmbd.RandomVariable("stiffness", distribution, units="N/m"))
        uqmbd.Study("o", mechanism, [0, 0.1], [Collocation(order=2)]).run(progress=Told())
    assert told == ["collocation: tables of quantiles of stiffness"]


def newer():
    if not hasattr(scipy.stats, "Normal"):
        return {}
    weibull = scipy.stats.make_distribution(scipy.stats.weibull_min)
    return {
        "normal": scipy.stats.Normal(mu=1.5, sigma=0.2), "standard normal": scipy.stats.Normal(), "uniform": scipy.stats.Uniform(a=-1.0, b=3.0),
        "moved": 2 * scipy.stats.Normal() + 1, "Weibull": weibull(c=2.5), "truncated": scipy.stats.truncate(scipy.stats.Normal(), -1, 2),
    }  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("name", newer())
def test_the_newer_distributions_of_scipy(name):
    given = newer()[name]
    space = holds(given, given.icdf, given.cdf, given.mean(), given.standard_deviation(), given.support())
    assert space.germs[0].family == {"uniform": "legendre", "normal": "hermite", "standard normal": "hermite"}.get(
        name, "stieltjes"
    )


def of_openturns():
    ot = pytest.importorskip("openturns")
    return {
        "Normal": ot.Normal(1.5, 0.2), "Uniform": ot.Uniform(2, 5), "Beta": ot.Beta(2, 3, -1, 4), "Gamma": ot.Gamma(2.5, 4, 1),
        "LogNormal": ot.LogNormal(0.3, 0.2, 1), "Exponential": ot.Exponential(3, 1), "ChiSquare": ot.ChiSquare(5), "Arcsine": ot.Arcsine(1, 2),
        "WeibullMin": ot.WeibullMin(2, 1.5, 3), "Gumbel": ot.Gumbel(0.5, 1), "Triangular": ot.Triangular(-1, 0.5, 2), "Logistic": ot.Logistic(1, 2),
        "TruncatedNormal": ot.TruncatedNormal(1, 2, 0, 4), "Student": ot.Student(12, 1, 0.3), "Trapezoidal": ot.Trapezoidal(-2, -1, 1, 2),
        "Laplace": ot.Laplace(1, 2), "Rayleigh": ot.Rayleigh(2, 1), "truncated": ot.TruncatedDistribution(ot.Gumbel(1, 0), -1.0, 3.0),
        "sum": 2 * ot.Gumbel(1, 0) + 3, "kernels": ot.KernelSmoothing().build([[0.1 * k * k] for k in range(8)]),
    }  # fmt: skip


OPENTURNS = (
    "Normal", "Uniform", "Beta", "Gamma", "LogNormal", "Exponential", "ChiSquare", "Arcsine", "WeibullMin", "Gumbel", "Triangular",
    "Logistic", "TruncatedNormal", "Student", "Trapezoidal", "Laplace", "Rayleigh", "truncated", "sum", "kernels",
)  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("name", OPENTURNS)
def test_distributions_of_openturns(name):
    given = of_openturns()[name]

    def column(of):
        return lambda x: np.ravel(of(np.asarray(x)[:, None]))

    ends = given.getRange()
    low = ends.getLowerBound()[0] if ends.getFiniteLowerBound()[0] else -np.inf
    high = ends.getUpperBound()[0] if ends.getFiniteUpperBound()[0] else np.inf
    holds(
        given, lambda u: np.ravel(given.computeQuantile(list(u))), column(given.computeCDF), given.getMean()[0],
        given.getStandardDeviation()[0], (low, high),
    )  # fmt: skip


WHOLE = {
    "binom": scipy.stats.binom(5, 0.3),
    "poisson": scipy.stats.poisson(3, loc=2),
    "randint": scipy.stats.randint(2, 7),
    "geom": scipy.stats.geom(0.4),
    "values": scipy.stats.rv_discrete(values=([1, 4, 9], [0.2, 0.5, 0.3])),
}


@pytest.mark.parametrize("name", WHOLE)
def test_whole_numbers_are_taken_as_those_of_chaospy(name):
    given = WHOLE[name]
    joint = JointInput.of([uqmbd.RandomVariable("x", given)])
    u = np.linspace(0, 1, 20002)[1:-1]  # meets no step of the distribution function
    assert np.array_equal(joint.from_uniform(u[:, None])[:, 0], given.ppf(u))
    space = GermSpace.of(joint)
    assert space.germs[0].family == "discrete"
    assert np.array_equal(space.to_inputs(space.from_uniform(u[:, None]))[:, 0], given.ppf(u))
    count = min(space.germs[0].values, 8)
    nodes, weights = space.germs[0].gauss(count)
    inputs = space.to_inputs(nodes[:, None])[:, 0]
    assert weights @ inputs == pytest.approx(given.mean(), rel=1e-9)
    assert weights @ (inputs - given.mean()) ** 2 == pytest.approx(given.var(), rel=1e-9)
    assert joint.means[0] == pytest.approx(given.mean(), rel=1e-9)


def test_whole_numbers_of_the_other_kinds():
    if hasattr(scipy.stats, "Binomial"):
        newer = JointInput.of([uqmbd.RandomVariable("x", scipy.stats.Binomial(n=5, p=0.3))])
        assert np.array_equal(newer.from_uniform(LEVELS[:, None])[:, 0], scipy.stats.binom(5, 0.3).ppf(LEVELS))
    ot = pytest.importorskip("openturns")
    joint = JointInput.of([uqmbd.RandomVariable("x", ot.Poisson(4))])
    assert np.array_equal(joint.from_uniform(LEVELS[:, None])[:, 0], scipy.stats.poisson(4).ppf(LEVELS))


def test_vectors_of_scipy_and_openturns():
    """Of scipy against chaospy's own; of OpenTURNS against its own transformation to standard normal variables."""
    covariance = [[4.0, 1.0], [1.0, 9.0]]
    u = np.random.default_rng(3).uniform(0.01, 0.99, (50, 2))
    ours = JointInput.of(uqmbd.random_vector(["a", "b"], scipy.stats.multivariate_normal([1, 2], covariance)))
    theirs = JointInput.of(uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1, 2], covariance)))
    assert np.array_equal(ours.from_uniform(u), theirs.from_uniform(u))
    ot = pytest.importorskip("openturns")
    coupled = ot.JointDistribution(
        [ot.Gumbel(1, 2), ot.Uniform(0, 3)], ot.NormalCopula(ot.CorrelationMatrix([[1, 0.6], [0.6, 1]]))
    )
    for given in (
        coupled,
        ot.Normal([1, 2], ot.CovarianceMatrix(covariance)),
        ot.JointDistribution([ot.Gumbel(1, 2), ot.Uniform(0, 3)]),
    ):
        joint = JointInput.of(uqmbd.random_vector(["a", "b"], given))
        expected = np.array(given.getInverseIsoProbabilisticTransformation()(ndtri(u)))
        assert np.abs(joint.from_uniform(u) - expected).max() < 1e-7
        space = GermSpace.of(joint)
        assert np.abs(space.to_inputs(space.from_uniform(u)) - expected).max() < 1e-6


REFUSED = {
    "a family": (scipy.stats.weibull_min, "is scipy.stats.weibull_min without parameters; expected an object with parameters"),
    "several at once": (scipy.stats.norm([0, 1], 2), r"whose loc has the shape \(2,\); expected one number"),
    "no distribution": (scipy.stats.norm(0, -1), "scipy.stats.norm.* is not a valid distribution"),
    "several variables": (scipy.stats.dirichlet([1, 2]), "dirichlet_frozen of scipy.stats"),
    "a vector": (scipy.stats.multivariate_normal([0, 1]), "has 2 dimensions; expected 1: for dependent variables use"),
}  # fmt: skip


@pytest.mark.parametrize(("given", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused(given, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        uqmbd.RandomVariable("x", given)


def test_what_is_refused_of_others():
    if hasattr(scipy.stats, "Normal"):
        with pytest.raises(
            uqmbd.StudyError, match="is the class scipy.stats.Normal; expected an object with parameters"
        ):
            uqmbd.RandomVariable("x", scipy.stats.Normal)
        with pytest.raises(uqmbd.StudyError, match=r"a distribution of several variables \(shape \(2,\)\)"):
            uqmbd.RandomVariable("x", scipy.stats.Normal(mu=[0.0, 1.0], sigma=1.0))
    ot = pytest.importorskip("openturns")
    for given, words in (
        (ot.Normal, "is the class openturns.Normal; expected an object with parameters"),
        (ot.FiniteDiscreteDistribution([[0.5], [1.25]]), "expected whole numbers only"),
        (ot.Dirac(2.0), "all of its quantiles are 2"),
        (ot.Normal(2), "has 2 dimensions, expected 1"),
    ):
        with pytest.raises(uqmbd.StudyError, match=words):
            uqmbd.RandomVariable("x", given)
    clayton = ot.JointDistribution([ot.Normal(), ot.Uniform()], ot.ClaytonCopula(2.0))
    with pytest.raises(uqmbd.StudyError, match="ClaytonCopula of OpenTURNS; expected NormalCopula, or no copula"):
        uqmbd.random_vector(["a", "b"], clayton)


@pytest.mark.thorough
def test_no_other_package_is_imported_to_look_at_a_distribution():
    """What `uqmbd.RandomVariable` refuses, and what it takes of scipy, brings no OpenTURNS."""
    script = (
        "import scipy.stats, sys, uqmbd\n"
        "uqmbd.RandomVariable('x', scipy.stats.gumbel_r(1, 2)).mean\n"
        "try: uqmbd.RandomVariable('x', 'normal')\n"
        "except uqmbd.StudyError: pass\n"
        "assert 'openturns' not in sys.modules, 'openturns'\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.thorough
def test_a_study_runs_with_them_and_its_surrogate_is_loaded_without_them(tmp_path):
    """Evaluated after loading in a process that can import neither OpenTURNS nor chaospy."""
    mechanism = oscillator(uqmbd.RandomVariable("stiffness", scipy.stats.weibull_min(3, loc=90, scale=12), units="N/m"))
    times = np.linspace(0, 0.5, 6)
    study = uqmbd.Study("oscillator", mechanism, times, [Collocation(order=3), MonteCarlo(samples=64, seed=1)])
    tree = study.run(workers=2)
    surrogate = uqmbd.results.surrogate(tree["collocation"])
    stiffness = tree["monte-carlo/samples/inputs"].values
    samples = tree["monte-carlo/samples/response"].values
    assert np.abs(surrogate.evaluate(stiffness) - samples).max() < 1e-3 * np.abs(samples).max()
    uqmbd.results.save(tree, tmp_path / "results.nc")
    np.save(tmp_path / "expected.npy", surrogate.evaluate(stiffness))
    np.save(tmp_path / "stiffness.npy", stiffness)
    script = (
        "import sys\nsys.modules['openturns'] = sys.modules['chaospy'] = None\n"
        "import numpy as np, uqmbd.results\n"
        "tree = uqmbd.results.load('results.nc')\n"
        "found = uqmbd.results.surrogate(tree['collocation']).evaluate(np.load('stiffness.npy'))\n"
        "assert np.array_equal(found, np.load('expected.npy'))\n"
        "assert not [name for name in sys.modules if 'wrapped' in name and name.startswith('uqmbd')]\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=tmp_path)


def test_numbers_are_made_random_by_them():
    """`Mechanism.randomise` takes a factor, or a function from number to distribution."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    mechanism.body("stone", mass=2.0)
    (mass,) = mechanism.randomise("stone.mass", distribution=scipy.stats.uniform(0.9, 0.2))
    assert mass.mean == pytest.approx(2.0)
    other = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    other.body("stone", mass=2.0)
    (mass,) = other.randomise("stone.mass", distribution=lambda value: scipy.stats.gamma(100, scale=value / 100))
    assert mass.mean == pytest.approx(2.0)

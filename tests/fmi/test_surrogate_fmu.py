"""FMUs of surrogates of every kind equal `evaluate`, in their values and derivatives, by the binary that is compiled."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_fmi import export_fmu, read_distributions
from uqmbd_fmi.compiling import find_compiler, host, zig
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper

from .library import Fmu
from .surrogates import KINDS, TIMES, aligned, drawn, node, plain_inputs, polynomial

compiled = pytest.mark.skipif(
    host() is None or find_compiler() is None, reason="there is no C compiler, or no binary for this platform"
)

COUNT = 50


@pytest.fixture
def exported(tmp_path):
    """Export surrogates and load the FMU."""

    def make(*surrogates, fmi=2, **options):
        done = export_fmu(node(*surrogates), tmp_path / f"one{fmi}.fmu", fmi=fmi, **options)
        assert done.warnings == ""
        return Fmu(done.path, tmp_path / f"unpacked{fmi}")

    return make


def same(found, expected, tolerance=1e-12):
    """Whether numbers agree, relative to the largest one; NaN agrees with NaN."""
    scale = max(1.0, float(np.nanmax(np.abs(expected))))
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale)


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_values_equal_those_of_evaluate(kind, fmi, exported):
    surrogate = KINDS[kind]()
    fmu = exported(surrogate, fmi=fmi)
    names = [o.name for o in surrogate.labels.outputs]
    points = drawn(surrogate.space, COUNT)
    expected = surrogate.evaluate(points)
    assert np.isfinite(expected).mean() > 0.9
    for point, values in zip(points, expected, strict=True):
        same(fmu.along(TIMES, dict(zip(surrogate.space.inputs, point, strict=True)), names), values)
    fmu.free()


@compiled
@pytest.mark.thorough
def test_the_surrogate_of_galerkin_is_exported(tmp_path):
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(10, 0.5), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=stiffness))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("oscillator", mechanism, np.linspace(0, 1, 6), [Galerkin(order=2)])
    found = study.run()["galerkin"]
    fmu = Fmu(export_fmu(found, tmp_path / "one.fmu").path, tmp_path)
    surrogate = uqmbd.results.surrogate(found)
    for point in drawn(surrogate.space, COUNT):
        expected = surrogate.evaluate(point[None])[0]
        same(fmu.along(study.times, {"stiffness": point[0]}, ["x"]), expected)


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_equal_those_of_gradient(kind, exported):
    surrogate = KINDS[kind]()
    fmu = exported(surrogate, fmi=3)
    names, inputs = [o.name for o in surrogate.labels.outputs], list(surrogate.space.inputs)
    points = drawn(surrogate.space, 10, seed=2)
    expected = surrogate.gradient(points)
    seed = np.random.default_rng(3).normal(size=len(inputs))
    for point, slopes in zip(points, expected, strict=True):
        fmu.along(TIMES[:4], dict(zip(inputs, point, strict=True)), names)
        along = np.tensordot(seed, slopes[:, :, 3], 1)
        same(fmu.derivative(names, inputs, seed), along, 1e-9 if kind in ("families", "dependent") else 1e-11)


@compiled
@pytest.mark.thorough
def test_statistics_and_stated_errors_are_those_of_the_surrogate(exported):
    surrogate, scalars = polynomial(plain_inputs()), polynomial(plain_inputs(), 2, outputs=("top",), times=None)
    fmu = exported(surrogate, scalars, quantiles=(0.1, 0.9))
    statistics = ("mean", "std", "quantile(0.1)", "quantile(0.9)", "stated_error", "valid")
    names = [f"{o}.{s}" for o in ("y", "top") for s in statistics]
    found = fmu.along(TIMES, {}, names)
    low, high = surrogate.quantiles((0.1, 0.9))
    same(found[:5], np.stack([surrogate.mean[0], surrogate.std[0], low[0], high[0], surrogate.verification_rms()[0]]))
    assert found[5].tolist() == [1.0] * len(TIMES)
    low, high = scalars.quantiles((0.1, 0.9))
    expected = (scalars.mean[0], scalars.std[0], low[0], high[0], scalars.verification_rms()[0], 1.0)
    same(found[6:], np.repeat(np.array(expected)[:, None], len(TIMES), 1))


@compiled
def test_parameters_start_at_the_means_and_outputs_between_times_are_interpolated(exported):
    surrogate = polynomial(plain_inputs())
    fmu = exported(surrogate)
    assert fmu.begin() == 0
    same(fmu.get(["a", "b"]), [3.0, 0.5])
    assert fmu.step(0.0, 0.15) == 0
    before, after = surrogate.evaluate([[3.0, 0.5]])[0, 0, 1:3]
    same(fmu.get(["y"]), [before + (after - before) / 3])
    assert fmu.get(["y.stated_error"]) > np.interp(0.15, TIMES, surrogate.verification_rms()[0])


@compiled
def test_segments_are_exact_between_output_times(exported):
    surrogate = aligned(plain_inputs())
    fine = np.unique(np.concatenate([TIMES, np.linspace(0, 1, 23)]))
    from dataclasses import replace

    expected = replace(surrogate, labels=replace(surrogate.labels, times=fine)).evaluate([[3.1, 0.2]])[0]
    same(exported(surrogate).along(fine, {"a": 3.1, "b": 0.2}, ["y", "z"]), expected)


@compiled
def test_inputs_outside_their_support_and_late_times_are_not_valid(exported):
    fmu = exported(polynomial(plain_inputs()))
    found = fmu.along(TIMES, {"a": 3.0, "b": 2.5}, ["y", "y.valid"])
    assert np.isnan(found[0]).all() and not found[1].any()
    assert any("input b is 2.5" in text for status, text in fmu.messages if status == 1)
    found = fmu.along([0.0, 1.0, 1.5], {"a": 3.0, "b": 1.5}, ["y", "y.valid", "y.mean"])
    assert found[1].tolist() == [1.0, 1.0, 0.0] and np.isnan(found[[0, 2], 2]).all() and np.isfinite(found[:, :2]).all()
    assert any("from 0 s to 1 s" in text for status, text in fmu.messages if status == 1)


@compiled
def test_a_state_is_saved_restored_and_serialised(exported):
    import ctypes as c

    fmu = exported(polynomial(plain_inputs()))
    fmu.along(TIMES[:3], {"a": 3.2, "b": 0.1}, ["y"])
    here = fmu.get(["y", "a"])
    state, size = c.c_void_p(), c.c_size_t()
    assert fmu.call("GetFMUstate", c.byref(state)) == 0
    assert fmu.call("SerializedFMUstateSize", state, c.byref(size)) == 0
    stored = (c.c_ubyte * size.value)()
    assert fmu.call("SerializeFMUstate", state, stored, size) == 0
    assert fmu.set(["a"], [2.9]) == 0 and fmu.step(0.25, 0.25) == 0
    assert fmu.get(["y"])[0] != here[0]
    assert fmu.call("SetFMUstate", state) == 0
    assert fmu.get(["y", "a"]).tolist() == here.tolist()
    assert fmu.reset() == 0
    again = c.c_void_p()
    assert fmu.call("DeSerializeFMUstate", stored, size, c.byref(again)) == 0
    assert fmu.call("SetFMUstate", again) == 0
    assert fmu.get(["y", "a"]).tolist() == here.tolist()
    stored[0] ^= 1
    assert fmu.call("DeSerializeFMUstate", stored, size, c.byref(again)) == 3
    assert fmu.call("FreeFMUstate", c.byref(state)) == 0 and state.value is None


@pytest.mark.parametrize("kind", ["plain", "dependent", "families"])
@pytest.mark.parametrize("ending", [".fmu", ".ssv"])
def test_distributions_come_back(kind, ending, tmp_path):
    surrogate = KINDS[kind]()
    done = export_fmu(node(surrogate), tmp_path / "one.fmu", compiler="none")
    space = read_distributions(done.path.with_suffix(ending))
    uniform = np.random.default_rng(0).random((100, space.dimension))
    again, germs = space.to_inputs(space.from_uniform(uniform)), surrogate.space.from_uniform(uniform)
    assert np.array_equal(again, surrogate.space.to_inputs(germs))
    assert space.inputs == surrogate.space.inputs and done.platforms == ()


@pytest.mark.parametrize("kind", ["families", "dependent"])
def test_start_values_are_the_means(kind):
    """Means of chaospy, or of a million draws where it has none."""
    from uqmbd_fmi.surrogate_tables import input_means

    space = KINDS[kind]().space
    points = space.to_inputs(space.from_uniform(np.random.default_rng(0).random((200_000, space.dimension))))
    error = points.std(axis=0) / np.sqrt(len(points))
    assert (np.abs(input_means(space) - points.mean(axis=0)) < 5 * error).all()


def test_what_cannot_be_written_in_c_is_refused(tmp_path):
    pair = uqmbd.random_vector(["a", "b"], chaospy.Clayton(chaospy.J(chaospy.Normal(), chaospy.Uniform()), 2.0))
    with pytest.raises(uqmbd.StudyError, match="inputs a, b are dependent"):
        export_fmu(node(polynomial(pair, 1)), tmp_path / "one.fmu")
    surrogate = polynomial(plain_inputs(), outputs=("y", "y.mean"))
    with pytest.raises(uqmbd.StudyError, match="'y.mean'; rename"):
        export_fmu(node(surrogate), tmp_path / "one.fmu")
    with pytest.raises(uqmbd.StudyError, match="contains no surrogate"):
        import xarray as xr

        export_fmu(xr.DataTree(name="monte-carlo"), tmp_path / "one.fmu")
    for path, text in (("one.txt", "ending .fmu"), ("no/one.fmu", "does not exist")):
        with pytest.raises(uqmbd.StudyError, match=text):
            export_fmu(node(polynomial(plain_inputs(), 1)), tmp_path / path)
    with pytest.raises(uqmbd.StudyError, match="'no-such-compiler' was not found"):
        export_fmu(node(polynomial(plain_inputs(), 1)), tmp_path / "one.fmu", compiler="no-such-compiler")
    (tmp_path / "two.ssv").write_text("<a/>")
    with pytest.raises(uqmbd.StudyError, match="contains no distributions"):
        read_distributions(tmp_path / "two.ssv")


@compiled
def test_a_wrong_token_makes_no_instance(exported, tmp_path):
    fmu = exported(polynomial(plain_inputs(), 1))
    fmu.token = "{no}"
    fmu._instantiate()
    assert fmu.instance is None and "token is {no}" in fmu.messages[-1][1]


fmpy_needed = "fmpy is not installed"


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_fmpy_finds_nothing_and_simulates_the_same(kind, fmi, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason=fmpy_needed)
    from fmpy.validation import validate_fmu

    surrogate = KINDS[kind]()
    done = export_fmu(node(surrogate), tmp_path / "one.fmu", fmi=fmi)
    assert validate_fmu(str(done.path)) == []
    assert done.size < 500_000
    names = [o.name for o in surrogate.labels.outputs]
    for point in drawn(surrogate.space, 3, seed=5):
        values = dict(zip(surrogate.space.inputs, point.tolist(), strict=True))
        found = fmpy.simulate_fmu(
            str(done.path), start_values=values, stop_time=1.0, output_interval=0.25, output=names
        )
        expected = surrogate.evaluate([point])[0][:, [0, 2, 3, 4, 5]]
        same(np.array([found[name] for name in names]), expected)


@pytest.mark.slow
@pytest.mark.skipif(zig() is None, reason="ziglang is not installed")
def test_zig_compiles_without_warnings_for_this_computer_and_windows(tmp_path):
    done = export_fmu(node(polynomial(plain_inputs())), tmp_path / "one.fmu", compiler="zig", windows=True)
    assert done.warnings == "" and "x86_64-windows" in done.platforms and done.size < 500_000

"""Arrays and texts reach the page's scripts as they were; nothing in them ends the element of a script."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from uqmbd.report.charts import json_script, packed, packed_relative, packed_within, share_arrays, unpacked
from uqmbd.report.charts.arrays import packed_selection
from uqmbd.report.live import joined_modules

SHAPES = arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5)


@given(st.sampled_from(["float32", "float64", "int32"]).flatmap(lambda kind: arrays.arrays(kind, SHAPES)))
def test_an_array_comes_back_to_the_bit(values):
    found = unpacked(json.loads(json.dumps(packed(values, str(values.dtype)))))
    assert found.dtype == values.dtype and found.shape == values.shape
    assert found.tobytes() == values.tobytes()


@pytest.mark.parametrize(
    ("values", "kind"), [([1e300], "float32"), ([0.5], "int32"), ([np.nan], "int32"), ([2**40], "int32")]
)
def test_numbers_that_do_not_fit_are_refused(values, kind):
    with pytest.raises(ValueError, match=f"numbers that {kind} cannot represent"):
        packed(values, kind)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=5, deadline=None)
@given(st.sampled_from(["float32", "float64", "int32"]), st.integers(0, 2**32 - 1))
def test_the_page_reads_the_numbers_of_python(node, kind, seed):
    draw = np.random.default_rng(seed).normal(size=(3, 4)) * 1e6
    values = np.round(draw) if kind == "int32" else draw.astype(kind)
    answer = node(
        ["arrays.js"], "const a = unpackArray(given);\nanswer = [a.shape, Array.from(a.values)];", packed(values, kind)
    )
    assert answer[0] == [3, 4] and np.array_equal(np.reshape(answer[1], (3, 4)), values)


@pytest.mark.parametrize(
    "values",
    [np.linspace(0.1, 0.7, 401), np.linspace(-3.0, 1e300, 50), np.full((3, 4), -2.5), np.zeros(9), np.arange(7.0)],
)
def test_ranges_and_constants_are_short_and_exact(values):
    data = packed(values)
    assert len(json.dumps(data)) < 110 and unpacked(json.loads(json.dumps(data))).tobytes() == values.tobytes()


def rounded_cases(count):
    """Yield arrays, what may be lost, and how far apart similar numbers are."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        shape = tuple(rng.integers(1, 7, size=rng.integers(1, 4)))
        values = rng.normal(size=shape) * 10.0 ** rng.integers(-200, 200)
        if rng.random() < 0.3:
            values = np.cumsum(values, axis=-1) + 1e3 * np.abs(values).max()
        allowed = np.abs(values).max() * 10.0 ** rng.uniform(-14, -1, size=shape[-1:] if rng.random() < 0.5 else ())
        if rng.random() < 0.3:
            values[rng.random(size=shape) < 0.3] = np.nan
        yield values, allowed, int(rng.integers(0, 5))


def test_no_number_changes_by_more_than_is_allowed():
    for values, allowed, lag in rounded_cases(2000):
        data = json.loads(json.dumps(packed_within(values, allowed, lags=[lag])))
        found = unpacked(data)
        assert found.shape == values.shape and np.array_equal(np.isnan(found), np.isnan(values))
        assert (np.abs(found - values) <= allowed)[~np.isnan(values)].all()
        assert len(str(data)) <= len(str(packed(values)))


def test_the_page_reads_the_numbers_that_are_allowed(node):
    cases = [packed_within(values, allowed, lags=[lag]) for values, allowed, lag in rounded_cases(300)]
    assert sum("eighths" in one for one in cases) > 50 and any(one.get("unknown") for one in cases)
    found = node(["arrays.js"], "answer = given.map((one) => Array.from(unpackArray(one).values, String));", cases)
    for data, values in zip(cases, found, strict=True):
        np.testing.assert_allclose(np.array(values, dtype=float), unpacked(data).ravel(), rtol=1e-15)


def test_numbers_of_any_size_keep_their_digits(node):
    """Each number keeps its part, and short numbers are exact; rounding of much larger neighbours is allowed."""
    rng = np.random.default_rng(3)
    cases = [rng.normal(size=(3, 50)) * 10.0 ** rng.integers(-8, 8, size=(3, 50)) for _ in range(20)]
    cases += [np.exp(np.linspace(-30, 5, 900)), np.zeros(40), np.full(9, np.nan), np.array([1.0, -2.5, 0.0, 1e300])]
    cases[0][1, 7] = np.nan
    kept = [packed_relative(values, 1e-5) for values in cases]
    assert len(str(kept[20])) < 0.5 * len(str(packed(cases[20])))
    assert unpacked(packed_relative(np.array([1.0, -0.5, 3.0] * 99), 1e-5)).tolist() == [1.0, -0.5, 3.0] * 99
    found = node(["arrays.js"], "answer = given.map((one) => Array.from(unpackArray(one).values, String));", kept)
    for values, data, read in zip(cases, kept, found, strict=True):
        back = unpacked(data)
        assert back.shape == values.shape and np.array_equal(np.isnan(back), np.isnan(values))
        flat = values.ravel()
        near = [np.nanmax(np.abs(flat[k // 16 * 16 : k // 16 * 16 + 16]), initial=0.0) for k in range(len(flat))]
        limit = np.maximum(1e-5 * np.abs(flat), 1e-13 * np.array(near))
        assert (np.abs(back.ravel() - flat) <= limit)[np.isfinite(flat)].all()
        np.testing.assert_allclose(np.array(read, dtype=float), back.ravel(), rtol=1e-15)


@pytest.mark.parametrize("places", [np.linspace(0.3, 42.0, 4201), np.random.default_rng(0).normal(size=900).cumsum()])
def test_chosen_times_are_exact(node, places):
    """Of times at equal distances their numbers are stored; others are stored themselves."""
    chosen = np.sort(np.random.default_rng(1).choice(len(places), 500, replace=False))
    data = packed_selection(places, chosen)
    assert np.array_equal(unpacked(data), places[chosen])
    assert ("chosen" in data) == (len(places) > 1000) and (len(str(data)) < 1500) == ("chosen" in data)
    answer = node(["arrays.js"], "const a = unpackArray(given);\nanswer = [a.shape, Array.from(a.values)];", data)
    assert answer[0] == [500] and np.array_equal(answer[1], places[chosen])
    assert np.array_equal(unpacked(packed_selection(places, np.arange(len(places)))), places)


def test_a_page_has_each_array_once(node):
    rng = np.random.default_rng(0)
    twice, once, short = (json_script(packed(rng.normal(size=n))) for n in (40, 41, 3))
    said = f'<p>"base64":"{"A" * 200}" "base64":"{"A" * 200}"</p>'
    page, arrays = share_arrays(f"{said}{twice}{once}{short}{twice}{short}")
    assert arrays == [json.loads(twice)["base64"]] and page.count('"base64":0') == 2
    assert page.startswith(said) and page.count(once) == 1 and page.count(short) == 2
    stub = f"const document = {{ getElementById: () => ({{ textContent: {json.dumps(json.dumps(arrays))} }}) }};"
    given = json.loads(twice) | {"base64": 0}
    answer = node(["arrays.js"], f"{stub}\nanswer = Array.from(unpackArray(given).values);", given)
    assert np.array_equal(answer, unpacked(json.loads(twice)))


@given(st.text())
def test_no_text_leaves_its_script(text):
    made = json_script({text: [text, "</script><!--", "\u2028"]})
    assert not set("<>&\u2028\u2029") & set(made)
    assert json.loads(made) == {text: [text, "</script><!--", "\u2028"]}


def test_json_holds_no_number_that_is_not_finite():
    with pytest.raises(ValueError):
        json_script([float("nan")])


def test_joined_modules_have_no_imports_left():
    text = joined_modules("arrays.js")
    assert "function unpackArray" in text and "export" not in text and "import" not in text
    assert joined_modules("arrays.js", "arrays.js") == text

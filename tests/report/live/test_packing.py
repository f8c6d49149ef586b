"""Arrays and texts reach the page's scripts as they were; nothing in them ends the element of a script."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from uqmbd.report.charts import json_script, packed, unpacked
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
    with pytest.raises(ValueError, match=f"numbers that {kind} does not hold"):
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

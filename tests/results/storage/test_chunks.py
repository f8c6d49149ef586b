"""One output over time is read without the others."""

import numpy as np
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from uqmbd.results import save
from uqmbd.results.storage.chunks import LARGE, SMALL, chunks_of

SIZES = {"sample": 300, "output": 5, "time": 401}


def test_chunks_of_files(tmp_path):
    values = np.random.default_rng(0).normal(size=tuple(SIZES.values()))
    tree = xr.DataTree.from_dict(
        {"mine/samples": xr.Dataset({"response": (tuple(SIZES), values), "small": ("time", values[0, 0])})}
    )
    path = save(tree, tmp_path / "a.nc")
    with xr.open_datatree(path, engine="h5netcdf", chunks={}) as found:
        response = found["mine/samples/response"]
        chunks = response.encoding["chunksizes"]
        assert tuple(chunks) == (300, 1, 401)
        np.testing.assert_array_equal(response.isel(output=3).values, values[:, 3])


@given(
    st.lists(st.sampled_from(["sample", "probability", "output", "time", "term"]), min_size=1, unique=True),
    st.integers(1, 2000),
    st.integers(1, 2000),
)
def test_a_chunk_is_no_more_than_one_output_and_not_much_more_than_a_few_megabytes(dims, some, other):
    shape = tuple({"time": some, "output": 1 + other % 7}.get(dim, other) for dim in dims)
    # no memory is taken
    variable = xr.Variable(dims, np.broadcast_to(0.0, shape))
    chunks = dict(zip(dims, chunks_of(variable), strict=True))
    size = 8 * int(np.prod(list(chunks.values())))
    assert all(1 <= chunks[dim] <= variable.sizes[dim] for dim in dims)
    if variable.nbytes <= SMALL:
        assert tuple(chunks.values()) == shape
    else:
        assert chunks.get("output", 1) == 1 and chunks.get("time") in (None, variable.sizes.get("time"))
        assert size <= max(LARGE, 8 * variable.sizes.get("time", 1))

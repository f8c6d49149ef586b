"""Records as files and datasets: what is written comes back, and what is wrong is said in one clear message."""

from __future__ import annotations

import random
import string
import warnings

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd_calibration import Record, Series
from uqmbd_calibration.records import checked_records
from uqmbd_springs import SpringDamper

few = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

numbers = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(exclude_categories=("C", "Zl", "Zp", "Zs"), exclude_characters="/"), min_size=1).filter(
    lambda name: name not in ("time", ".", "..")
)
positive = st.floats(min_value=1e-300, max_value=1e300)


@st.composite
def all_series(draw, name=names):
    """A series with times of its own, or with none."""
    units = draw(st.sampled_from(["", "m", "rad", "m/s²", "kg m^2"]))
    noise = draw(st.none() | positive)
    output = draw(name)
    values = draw(st.lists(numbers, min_size=1, max_size=6))
    if draw(st.booleans()):
        return Series(output, [], values, units, noise)
    times = draw(st.lists(numbers, min_size=len(values), max_size=len(values), unique=True))
    return Series(output, sorted(times), values, units, noise)


records = st.builds(
    Record,
    names,
    st.lists(all_series(), min_size=1, max_size=4, unique_by=lambda one: one.output),
    st.dictionaries(names, numbers, max_size=2),
    st.text(string.printable.strip(), max_size=4),
)


@pytest.mark.thorough
@few
@given(records)
def test_a_record_that_is_written_is_read_as_it_was(tmp_path, record):
    assert Record.read(record.write(tmp_path / "record.nc")) == record


@few
@given(records)
def test_a_record_that_is_a_dataset_is_the_record_it_was(record):
    assert Record.of(record.to_dataset()) == record


def test_outputs_that_are_called_as_dimensions_are_are_kept_apart(tmp_path):
    own = [Series(name, [0.0, 1.0], [2.0, 3.0], "m") for name in ("time of b", "repetition", "b")]
    record = Record("r", [*own, Series("c", [], [1.0, 2.0], "s"), Series("d", [0.5], [2.0], "m")])
    assert Record.read(record.write(tmp_path / "record.nc")) == record


plain = st.text(string.ascii_letters + " _-.ä", min_size=1).map(str.strip).filter(lambda x: x and x.lower() != "time")


@pytest.mark.thorough
@few
@given(
    st.lists(plain.filter(lambda x: x not in (".", "..")), min_size=1, max_size=4, unique=True),
    st.lists(numbers, min_size=1, max_size=8, unique=True).map(sorted),
    st.sampled_from(",;\t"),
    st.sampled_from(["\n", "\r\n"]),
    st.data(),
)
def test_a_csv_file_holds_what_was_written_and_gaps_are_left_out_of_their_output_alone(
    tmp_path, outputs, times, mark, end, data
):
    assume(not any(_is_number(name) for name in outputs))
    cells = {
        name: data.draw(st.lists(st.none() | numbers, min_size=len(times), max_size=len(times))) for name in outputs
    }
    lines = [mark.join(["time [s]", *(f"{name} [m]" for name in outputs)])]
    for number, time in enumerate(times):
        row = [cells[name][number] for name in outputs]
        lines.append(mark.join([repr(time), *("" if x is None else repr(x) for x in row)]))
    path = tmp_path / "record.csv"
    path.write_bytes(end.join(["# measured in March", *lines, ""]).encode())
    there = {name: [x is not None for x in values] for name, values in cells.items()}
    if not all(any(kept) for kept in there.values()):
        with pytest.raises(uqmbd.StudyError, match="no values"):
            Record.read(path)
        return
    record = Record.read(path, noise={outputs[0]: 0.5})
    assert record.outputs == tuple(outputs)
    for name in outputs:
        assert record[name].times.tolist() == [t for t, kept in zip(times, there[name], strict=True) if kept]
        assert record[name].values.tolist() == [x for x in cells[name] if x is not None]
        assert record[name].units == "m"
        assert record[name].noise == (0.5 if name == outputs[0] else None)


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_without_times_the_lines_of_a_csv_file_are_repetitions(tmp_path):
    path = tmp_path / "tap test.csv"
    path.write_text("first [Hz],second [Hz]\n1.02,3.1\n1.03,nan\n0.99,3.2\n")
    record = Record.read(path)
    assert record.name == "tap test"
    assert record["first"].timeless and record["first"].values.tolist() == [1.02, 1.03, 0.99]
    assert record["second"].values.tolist() == [3.1, 3.2]
    assert record.times.size == 0


def test_the_times_of_a_record_are_those_of_all_outputs():
    record = Record(
        "r", [Series("a", [0, 1, 3], [1, 2, 3], "m"), Series("b", [1, 2], [1, 2], "m"), Series("c", [], [1], "")]
    )
    assert record.times.tolist() == [0, 1, 2, 3]


def test_what_is_simulated_is_a_record(study):
    assert Record.of(uqmbd.simulate(study.mechanism, study.times), outputs=["way", "frequency"]).checked_against(study)


def test_classic_netcdf_files_are_read(tmp_path):
    dataset(units="mm").to_netcdf(tmp_path / "r.nc", engine="scipy", format="NETCDF3_64BIT")
    assert Record.read(tmp_path / "r.nc")["a"] == Series("a", [0.0, 1.0], [1.0, 2.0], "mm")


def test_arrays_of_a_record_are_its_own_and_stay():
    values = np.array([1.0, 2.0])
    series = Series("a", [0, 1], values, "m")
    values[0] = 7
    assert series.values.tolist() == [1, 2]
    with pytest.raises(ValueError, match="read-only"):
        series.values[0] = 7


def test_what_is_masked_is_a_gap():
    series = Series("a", [0, 1, 2], np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]), "m")
    assert series.times.tolist() == [0, 2]


def test_what_the_caller_says_takes_the_place_of_what_the_file_says_but_units_must_agree(tmp_path):
    written = Record("r", [Series("a", [0], [1], "m", 0.1)], {"speed": 2.0}, "rig 1").write(tmp_path / "r.nc")
    read = Record.read(written, noise={"a": 0.2}, known={}, machine="rig 2", name="other", units={"a": "m"})
    assert read == Record("other", [Series("a", [0], [1], "m", 0.2)], {}, "rig 2")
    with pytest.raises(uqmbd.StudyError, match="'m' in the file and 'mm' in units="):
        Record.read(written, units={"a": "mm"})


WRONG_TABLES = {
    "": "no header",
    "# nothing\n": "no header",
    "time,a [m]\n": "no lines with values",
    "time\n0\n": "the file has only a column of times",
    "0,1\n1,2\n": "before the values",
    "time [ms],a [m]\n0,1\n": "the units of the times are 'ms'; expected seconds",
    "time,a\n0,1\n": "units of 'a' are missing",
    "time,a [m],a [m]\n0,1,2\n": "2 columns 'a'",
    "time,a [m],\n0,1,2\n": "name is ''",
    "time,a [m]\n0,1,2\n": "line 2: the line has 3 entries, but the header has 2 columns",
    "time,a [m]\n0,1\n1\n": "line 3: the line has 1 entries, but the header has 2 columns",
    "time,a [m]\n0,1\n,2\n": "line 3: the time is missing",
    "time,a [m]\n0,one\n": "line 2: 'a' is 'one'",
    "time;a [m]\n0;1,5\n": "expected a number with a decimal point",
    "time,a [m]\n0,1_0\n": "line 2: 'a' is '1_0'",
    "time,a [m]\n0,1\n0,2\n": "times do not increase: 0 s precedes 0 s",
    "time,a [m]\n1,1\n0.5,2\n": "times do not increase: 1 s precedes 0.5 s",
    "time,a [m]\n0,inf\n": "value no. 1 is infinite",
    "time,a [m]\ninf,1\n": "time no. 1 is not a finite number",
    "time,a [m]\n0,\n1,nan\n": "the series has no values",
    'time,a [m]\n0,"1\n': "is not valid CSV",
    "time,a/b [m]\n0,1\n": "without '/'",
    "time,a\0 [m]\n0,1\n": "null characters",
}


@pytest.mark.parametrize("text", WRONG_TABLES)
def test_a_csv_file_that_is_wrong_is_refused_and_it_is_reported_why(tmp_path, text):
    path = tmp_path / "wrong.csv"
    path.write_bytes(text.encode())
    with pytest.raises(uqmbd.StudyError) as caught:
        Record.read(path)
    assert WRONG_TABLES[text] in str(caught.value) and str(path) in str(caught.value)


def test_files_that_are_none_are_refused(tmp_path):
    path = tmp_path / "latin.csv"
    path.write_bytes("time,weg [m] für\n".encode("latin-1"))
    wrong = {
        path: "not UTF-8 text",
        tmp_path / "none.csv": "the file does not exist",
        tmp_path / "a.xlsx": "expected .csv",
        tmp_path: r"expected \.csv \(or \.tsv, \.txt\) or \.nc for a record",
    }
    for place, message in wrong.items():
        with pytest.raises(uqmbd.StudyError, match=message):
            Record.read(place)
    with pytest.raises(uqmbd.StudyError, match="the path is 3"):
        Record.read(3)


GOOD = "# rig\ntime [s],angle [rad],force [N]\n0,1.0,\n0.1,0.9,12\n0.2,,11.5\n"


@pytest.mark.thorough
def test_files_that_are_changed_at_random_are_records_or_refused_in_one_line(tmp_path):
    """Bytes are changed, taken away and doubled: what comes is a record or a StudyError that names the file."""
    rng = random.Random(3)
    good = tmp_path / "good.nc"
    Record("r", [Series("a", [0.0, 1.0], [1.0, 2.0], "m", 0.1)], {"k": 2.0}).write(good)
    sources = {"csv": GOOD.encode(), "nc": good.read_bytes()}
    refused = {"csv": 0, "nc": 0}
    for ending, count in {"csv": 400, "nc": 150}.items():
        path = tmp_path / f"changed.{ending}"
        for _ in range(count):
            content = bytearray(sources[ending])
            for _ in range(rng.choice((1, 1, 2, 20))):
                at = rng.randrange(len(content))
                kind = rng.randrange(4)
                if kind == 0:
                    content[at] = rng.choice(b"\0\xff,;\n\t\"'[]#e-.0 9nai")
                elif kind == 1:
                    content[at] = rng.randrange(256)
                elif kind == 2:
                    del content[at : at + rng.randrange(1, 30)]
                else:
                    content[at:at] = content[at : at + rng.randrange(1, 30)]
                content = content or bytearray(b" ")
            path.write_bytes(content)
            try:
                record = Record.read(path)
            except uqmbd.StudyError as error:
                refused[ending] += 1
                assert str(path) in str(error) and len(str(error)) < 1000
            else:
                assert all(np.isfinite(one.values).all() and (np.diff(one.times) > 0).all() for one in record.series)
    assert refused["csv"] > 100 and refused["nc"] > 20


def dataset(**changes):
    """A dataset of one variable at times, with changes of it."""
    about = {
        "dims": "time",
        "values": [1.0, 2.0],
        "units": "m",
        "times": [0.0, 1.0],
        "time_units": "s",
        "attrs": {},
    } | changes
    made = xr.Dataset({"a": (about["dims"], about["values"], {"units": about["units"]})}, attrs=about["attrs"])
    return made.assign_coords(time=("time", about["times"], {"units": about["time_units"]}))


WRONG_DATASETS = {
    "of variable 'a' has the units 'ms'; expected 's'": dataset(time_units="ms"),
    "dates or durations": dataset(times=np.array([0, 1], "datetime64[s]").astype("datetime64[ns]")),
    "do not increase": dataset(times=[1.0, 0.0]),
    "expected one dimension, the times": dataset(dims=("time", "x"), values=[[1.0], [2.0]]),
    "attribute units of variable 'a' is 3": dataset(units=3),
    "expected numbers": dataset(values=["x", "y"]),
    "attribute known is 'x'": dataset(attrs={"known": "x"}),
    "the known 'k' is 'x'": dataset(attrs={"known": '{"k": "x"}'}),
    "the known 'k' is True": dataset(attrs={"known": '{"k": true}'}),
    "machine is 3": dataset(attrs={"machine": 3}),
    "no variables": xr.Dataset(),
    "the type of dataset is dict": {},
}


@pytest.mark.parametrize("message", WRONG_DATASETS)
def test_a_dataset_that_is_wrong_is_refused_and_it_is_reported_why(message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Record.of(WRONG_DATASETS[message])


A = [Series("a", [0.0], [1.0], "m")]

WRONG_ARGUMENTS = {
    "its noise is 0": lambda: Series("a", [0], [1], "m", 0),
    "its noise is -1": lambda: Series("a", [0], [1], "m", -1),
    "its noise is nan": lambda: Series("a", [0], [1], "m", float("nan")),
    "its noise is True": lambda: Series("a", [0], [1], "m", True),
    "its noise is '1'": lambda: Series("a", [0], [1], "m", "1"),
    "2 values at 1 times": lambda: Series("a", [0], [1, 2], "m"),
    "its values are 'x'": lambda: Series("a", [0], "x", "m"),
    "its values are [1j]": lambda: Series("a", [0], [1j], "m"),
    "shape": lambda: Series("a", [0], [[1]], "m"),
    "the series has no values": lambda: Series("a", [], [], "m"),
    "units is None": lambda: Series("a", [0], [1], None),
    "the name is ''": lambda: Series("", [0], [1], "m"),
    "'time' is reserved": lambda: Series("time", [0], [1], "m"),
    "twice": lambda: Record("r", A + A),
    "series is empty": lambda: Record("r", []),
    "expected a list of Series": lambda: Record("r", "ab"),
    "known is 3": lambda: Record("r", A, 3),
    "the known 'k' is inf": lambda: Record("r", A, {"k": float("inf")}),
    "the name is 3": lambda: Record(3, A),
    "ends in .nc": lambda: Record("r", A).write("r.csv"),
    "noise contains 'b'": lambda: Record.of(Record("r", A).to_dataset(), noise={"b": 1}),
    "noise is 0.1": lambda: Record.of(Record("r", A).to_dataset(), noise=0.1),
    "has no output 'b'": lambda: Record.of(Record("r", A).to_dataset(), outputs=["b"]),
    "outputs is 'a'": lambda: Record.of(Record("r", A).to_dataset(), outputs="a"),
    "has no output 'c'": lambda: Record("r", A)["c"],
}


@pytest.mark.parametrize("message", WRONG_ARGUMENTS)
def test_an_argument_that_is_wrong_is_refused_and_it_is_reported_why(message):
    with pytest.raises(uqmbd.StudyError) as caught:
        WRONG_ARGUMENTS[message]()
    assert message in str(caught.value)


def test_some_outputs_of_a_file_can_be_read(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time,a [m],battery\n0,1,12\n")
    assert Record.read(path, outputs=["a"]).outputs == ("a",)


@pytest.fixture(scope="module")
def study():
    mechanism = uqmbd.Mechanism("mass", uqmbd.Translational())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    mechanism.output("way", mass.position[0], units="m")
    mechanism.output("acceleration", mass.acceleration[0], units="m/s^2")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    mechanism.output("turn", 10 * mass.position[0], units="rad", angle=True)
    return uqmbd.Study("mass", mechanism, np.linspace(1, 2, 3), [])


def one(output, times, values, units, known=None):
    return Record("run", [Series(output, times, values, units)], known or {})


def test_a_record_of_the_outputs_of_a_study_is_one_of_it(study):
    record = one("way", [1.0, 9.0], [1.0, 2.0], "m", {"stiffness": 81.0})
    assert record.checked_against(study) is record
    assert one("acceleration", [1.0], [1.0], "m/s²").checked_against(study)
    tap = Record("tap", [Series("frequency", [], [1.0, 1.1], "Hz")])
    assert checked_records(record, study) == (record,)
    assert checked_records([record, tap], study) == (record, tap)


def test_a_known_input_is_in_any_part_of_its_mixture():
    """A third of the probability of the stiffness is near 110, given a mass that is not at its median."""
    centres, covariances = [[1, 90], [2, 110], [3, 90]], np.stack([np.diag([0.01, 1.0])] * 3)
    names, units = ("inertia", "stiffness"), ("kg", "N/m")
    inertia, stiffness = uqmbd.random_vector(names, chaospy.GaussianMixture(centres, covariances), units)
    mechanism = uqmbd.Mechanism("mass", uqmbd.Translational())
    mass = mechanism.body("mass", mass=inertia, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    mechanism.output("way", mass.position[0], units="m")
    mixed = uqmbd.Study("mass", mechanism, np.linspace(1, 2, 3), [])
    assert one("way", [1], [1], "m", {"stiffness": 110.0}).checked_against(mixed)


UNLIKE_THE_STUDY = {
    "the units are 'mm' in the record and 'm' in the study": one("way", [1], [1], "mm"),
    "did you mean 'way'?": one("wya", [1], [1], "m"),
    "before the start of the study at 1 s": one("way", [0.5, 2], [1, 1], "m"),
    "it is an output over time": one("way", [], [1], "m"),
    "in the study it is a scalar output": one("frequency", [1], [1], "Hz"),
    "did you mean 'stiffness'?": one("way", [1], [1], "m", {"stifness": 90}),
    "outside its distribution from 80 to 120": one("way", [1], [1], "m", {"stiffness": 79}),
}


@pytest.mark.parametrize("message", UNLIKE_THE_STUDY)
def test_a_record_that_is_none_of_the_study_is_refused_and_it_is_reported_why(study, message):
    with pytest.raises(uqmbd.StudyError) as caught:
        UNLIKE_THE_STUDY[message].checked_against(study)
    assert message in str(caught.value) and "'run'" in str(caught.value)


@pytest.mark.parametrize("records", [[], None, "ab", [3], [one("way", [1], [1], "m")] * 2])
def test_what_is_no_list_of_different_records_is_refused(study, records):
    with pytest.raises(uqmbd.StudyError):
        checked_records(records, study)


def test_an_angle_within_a_turn_is_warned_of(study):
    angles = np.linspace(0, 20, 200)
    times = np.linspace(1, 2, 200)
    with pytest.warns(uqmbd.StudyWarning, match="unwrap"):
        one("turn", times, angles % (2 * np.pi), "rad").checked_against(study)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one("turn", times, angles, "rad").checked_against(study)

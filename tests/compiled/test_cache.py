"""The cache of kernels: never stale, never damaged, never somebody else's."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import symengine
from hypothesis import given
from hypothesis import strategies as st

import uqmbd
from uqmbd.compiled import Store, compilations, compile_kernel, source_digest
from uqmbd.mechanism import SplineTable
from uqmbd_joints import Distance

ROOT = Path(uqmbd.__file__).parents[1]
needs_root = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives files away")
posix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files without owners")

PULL = """
import uqmbd
from uqmbd_joints import Distance

mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
bob = mechanism.body("bob", mass=2, position=(0, -1))
rod = mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=1))
mechanism.output("pull", rod.reaction_force[1], units="N")
print(float(uqmbd.simulate(mechanism, [0.0, 0.1])["pull"][0]))
"""

DAMAGED = """
import random, sys
from pathlib import Path
import uqmbd
from uqmbd_joints import Distance
from uqmbd.compiled import compilations

def found():
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    bob = mechanism.body("bob", mass=2, position=(0, -1), velocity=(0.3, 0))
    rod = mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=1))
    mechanism.output("pull", rod.reaction_force[1], units="N")
    mechanism.output("x", bob.position[0], units="m")
    found = uqmbd.simulate(mechanism, [0.0, 0.05, 0.1])
    return found["pull"].values.tobytes() + found["x"].values.tobytes()

folder, generator, damages = Path(sys.argv[1]), random.Random(7), 0
expected = found()
while damages < int(sys.argv[2]):
    files = [f for f in folder.rglob("*") if f.is_file() and f.stat().st_size]  # the driver is read once
    assert files
    for file in files:
        data = bytearray(file.read_bytes())
        kind = generator.randrange(6)
        if kind == 0:
            data = data[:generator.randrange(len(data))]
        elif kind == 1:
            data += generator.randbytes(generator.randint(1, 9))
        else:
            data[generator.randrange(len(data))] ^= 1 << generator.randrange(8)
        file.write_bytes(data)
    damages += len(files)
    before = compilations[0]
    assert found() == expected, "a wrong number"
    assert compilations[0] > before, "damage was not seen"
print(damages)
"""


def run(script: str, cache: Path, *arguments: object, root: Path = ROOT) -> str:
    """Run a script in a process of its own, which may crash, and return what it prints."""
    path = os.pathsep.join([str(root), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
    environment = dict(os.environ, UQMBD_CACHE=str(cache), PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1")
    command = [sys.executable, "-c", script, *map(str, arguments)]
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def pull() -> float:
    """The force of a rod that carries 2 kg at rest, N."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    bob = mechanism.body("bob", mass=2, position=(0, -1))
    rod = mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=1))
    mechanism.output("pull", rod.reaction_force[1], units="N")
    return float(uqmbd.simulate(mechanism, [0.0, 0.1])["pull"][0])


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache that holds the kernels of `pull`."""
    pull()  # loads the driver, once for a process
    folder = tmp_path / "cache"
    monkeypatch.setenv("UQMBD_CACHE", str(folder))
    pull()
    return folder


def kernels(folder: Path) -> list[Path]:
    found = sorted(f for f in folder.rglob("*") if f.is_file())
    assert found
    return found


@pytest.mark.thorough
def test_changed_sign_in_the_equations_is_seen_at_once(tmp_path: Path) -> None:
    """The force of a rod changes its sign with the code that writes it, although its kernel is in the cache."""
    copy = tmp_path / "copy"
    shutil.copytree(ROOT / "uqmbd", copy / "uqmbd", ignore=shutil.ignore_patterns("__pycache__"))
    before = float(run(PULL, tmp_path / "cache", root=copy))
    source = copy / "uqmbd" / "dynamics" / "equations" / "outputs.py"
    old = "block.reaction_sign * e"
    assert source.read_text().count(old) == 1
    source.write_text(source.read_text().replace(old, "-" + old))
    after = float(run(PULL, tmp_path / "cache", root=copy))
    assert abs(before) == pytest.approx(2 * 9.81, rel=1e-6)
    assert after == -before


@pytest.mark.thorough
def test_every_source_of_equations_is_in_the_key(tmp_path: Path) -> None:
    folders = [ROOT / "uqmbd" / "dynamics", ROOT / "uqmbd" / "mechanism"]
    copies = [
        Path(shutil.copytree(f, tmp_path / f.name, ignore=shutil.ignore_patterns("__pycache__"))) for f in folders
    ]
    seen = {source_digest(folders)}
    assert source_digest(copies) in seen
    files = [f for folder in copies for f in folder.rglob("*.py")]
    assert len(files) > 40
    for file in files:
        file.write_bytes(file.read_bytes() + b"\n")
        seen.add(source_digest(copies))
    files[0].rename(files[0].with_name("renamed.py"))
    seen.add(source_digest(copies))
    assert len(seen) == len(files) + 2


@pytest.mark.thorough
@pytest.mark.parametrize("count", [100, pytest.param(2000, marks=pytest.mark.slow)])
def test_no_damage_crashes_or_gives_a_wrong_number(count: int, tmp_path: Path) -> None:
    """Flipped bits, lost ends and further bytes, in every kernel of a mechanism, again and again."""
    assert int(run(DAMAGED, tmp_path / "cache", tmp_path / "cache", count)) >= count


@pytest.mark.thorough
@given(content=st.binary(min_size=0, max_size=80), data=st.data())
def test_store_returns_what_was_put_there_or_nothing(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, data: st.DataObject
) -> None:
    store = Store(tmp_path_factory.mktemp("store"))
    store.put("key", content)
    assert store.get("key") == content
    whole = store.path("key").read_bytes()
    bit = data.draw(st.integers(0, 8 * len(whole) - 1))
    flipped = bytearray(whole)
    flipped[bit // 8] ^= 1 << bit % 8
    end = data.draw(st.integers(0, len(whole) - 1))
    for damaged in (bytes(flipped), whole[:end], whole + b"\0", b""):
        store.path("key").write_bytes(damaged)
        assert store.get("key") is None
    store.path("other").write_bytes(whole)
    assert store.get("other") is None, "the content of another key"


class Trap:
    """Leaves a trace where it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[object, tuple[str, ...]]:
        return os.mkdir, (str(self.trace),)


def set_traps(cache: Path, trace: Path) -> list[Path]:
    """Put traps in the place of all kernels, as someone would who knows how they are stored."""
    files = kernels(cache)
    for file in files:
        Store(file.parent).put(file.stem, pickle.dumps(Trap(trace)))
    return files


@posix
def test_what_others_may_have_written_is_not_unpickled(cache: Path, tmp_path: Path) -> None:
    for file in set_traps(cache, tmp_path / "trace"):
        file.chmod(0o660)
    assert abs(pull()) == pytest.approx(2 * 9.81)
    assert not (tmp_path / "trace").exists()
    assert all(file.stat().st_mode & 0o777 == 0o600 for file in kernels(cache)), "made again, for its owner alone"


@posix
def test_link_to_what_lies_elsewhere_is_not_followed(cache: Path, tmp_path: Path) -> None:
    for k, file in enumerate(set_traps(cache, tmp_path / "trace")):
        elsewhere = tmp_path / f"{k}.elsewhere"
        file.rename(elsewhere)
        file.symlink_to(elsewhere)
    assert abs(pull()) == pytest.approx(2 * 9.81)
    assert not (tmp_path / "trace").exists()


@needs_root
def test_what_another_user_put_there_is_not_unpickled(cache: Path, tmp_path: Path) -> None:
    for file in set_traps(cache, tmp_path / "trace"):
        os.chown(file, 12345, 12345)
    assert abs(pull()) == pytest.approx(2 * 9.81)
    assert not (tmp_path / "trace").exists()


@needs_root
def test_folder_of_another_user_is_not_used_and_that_is_reported(cache: Path, tmp_path: Path) -> None:
    set_traps(cache, tmp_path / "trace")
    before = {file: file.read_bytes() for file in kernels(cache)}
    os.chown(kernels(cache)[0].parent, 12345, 12345)
    with pytest.warns(UserWarning, match="belongs to another user") as warned:
        assert abs(pull()) == pytest.approx(2 * 9.81)
        assert abs(pull()) == pytest.approx(2 * 9.81)
    assert len(warned) == 1
    assert not (tmp_path / "trace").exists()
    assert {file: file.read_bytes() for file in kernels(cache)} == before


def test_plain_pickle_without_a_digest_is_not_loaded(cache: Path, tmp_path: Path) -> None:
    for file in kernels(cache):
        content = pickle.dumps(Trap(tmp_path / "trace"))
        file.write_bytes(content)
        file.with_suffix(".pickle").write_bytes(content)
    assert abs(pull()) == pytest.approx(2 * 9.81)
    assert not (tmp_path / "trace").exists()


@posix
@pytest.mark.parametrize("mode", [None, 0o755, 0o777, 0o1777, 0o2775, 0o700])
def test_own_folder_is_private_and_no_mode_is_changed(
    mode: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "a" / "b"
    if mode is not None:
        folder.mkdir(parents=True)
        (folder / "of another.txt").write_text("other")
        folder.chmod(mode)
    monkeypatch.setenv("UQMBD_CACHE", str(folder))
    pull()
    own = folder / f"uqmbd-{os.geteuid()}"
    assert own.stat().st_mode & 0o777 == 0o700
    assert all(file.stat().st_mode & 0o777 == 0o600 for file in kernels(own))
    if mode is not None:
        assert stat.S_IMODE(folder.stat().st_mode) == mode
        assert {p.name for p in folder.iterdir()} == {own.name, "of another.txt"}
    before = compilations[0]
    pull()
    assert compilations[0] == before, "taken from the cache"


@posix
@pytest.mark.parametrize("kind", ["link", "file", "writable"])
def test_a_place_that_is_not_ours_is_left_as_it_is_and_said_once(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where others may write, they may make what has the name of our folder."""
    place, victim = tmp_path / f"uqmbd-{os.geteuid()}", tmp_path / "documents"
    victim.mkdir(mode=0o755)
    if kind == "link":
        place.symlink_to(victim)
    elif kind == "file":
        place.write_text("text")
    else:
        place.mkdir()
        place.chmod(0o777)
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path))
    with pytest.warns(UserWarning, match="is not used: .* Remove it") as warned:
        for _ in range(2):
            assert abs(pull()) == pytest.approx(2 * 9.81)
    assert len(warned) == 1
    assert not list(victim.iterdir()) and stat.S_IMODE(victim.stat().st_mode) == 0o755
    assert kind != "writable" or (stat.S_IMODE(place.stat().st_mode) == 0o777 and not list(place.iterdir()))


def test_folder_that_cannot_be_written_costs_only_time_and_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(UserWarning, match="cannot be written .*UQMBD_CACHE") as warned:
        for _ in range(2):
            assert abs(pull()) == pytest.approx(2 * 9.81)
    assert len(warned) == 1


def test_full_disk_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    monkeypatch.setenv("UQMBD_CACHE", str(tmp_path / "cache"))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        with pytest.warns(UserWarning, match="cannot be written"):
            found = pull()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert abs(found) == pytest.approx(2 * 9.81)
    assert [p.name for p in (tmp_path / "cache").rglob("*")] == [f"uqmbd-{os.geteuid()}"]


def test_a_cached_kernel_with_a_table_loads_what_looks_it_up(tmp_path: Path) -> None:
    """As the first compiled code of a process."""
    x = symengine.Symbol("x")
    table = SplineTable(np.array([0.0, 1.0, 3.0]), np.array([[1.0], [2.0], [-1.0]]), "natural", "linear")
    constant = symengine.Function(table.name)(1, x)
    kernel = compile_kernel([x], [constant], tables={table.name: table})
    stored = tmp_path / "kernel"
    stored.write_bytes(pickle.dumps(kernel))
    script = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb'))([[0.5], [2.0]]).ravel().tolist())"
    assert json.loads(run(script, tmp_path / "cache", stored)) == [1.0, 2.0]  # values where the intervals begin

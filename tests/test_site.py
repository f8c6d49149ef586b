"""The site has a page for whatever is public, and its pages are written from the code."""

from __future__ import annotations

import ast
import importlib
import re
import shutil
import sys
import tomllib
from pathlib import Path

import pytest
import sympy
from PIL import Image

from uqmbd import plugins

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site():
    """The modules that write pages."""
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    yield importlib.import_module("uqmbd_site.reference")
    sys.path.remove(str(ROOT / "docs" / "_ext"))


@pytest.fixture(scope="module")
def pages(site, tmp_path_factory):
    """What is documented on the pages of the reference: full names to texts."""
    folder = tmp_path_factory.mktemp("site")
    site.write_reference(folder, pictures=False)
    found = {}
    for path in (folder / "reference" / "api").glob("*.rst"):
        text = path.read_text(encoding="utf-8")
        for name in re.findall(r"^\.\. auto(?:class|exception|function):: (\S+)$", text, re.M):
            found[name] = text
        for name, module in re.findall(r"^\.\. py:data:: (\S+)\n +:module: (\S+)$", text, re.M):
            found[f"{module}.{name}"] = text
    return found


def names_in_source(module):
    """The names that a package makes public, read from its text: its stub, or its ``__all__``."""
    base = ROOT if module.split(".")[0] == "uqmbd" else ROOT / "plugins"
    place = base.joinpath(*module.split("."))
    stub = place / "__init__.pyi"
    if stub.exists():
        tree = ast.parse(stub.read_text(encoding="utf-8"))
        imported = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        return {x.asname for node in imported for x in node.names if node.module}
    text = (place / "__init__.py" if place.is_dir() else place.with_suffix(".py")).read_text(encoding="utf-8")
    (listed,) = (
        node.value
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    )
    return set(ast.literal_eval(listed))


MODULES = [
    "uqmbd",
    *(f"uqmbd.{x}" for x in ("extend", "laws", "results", "report", "shapes", "testing", "typing")),
] + sorted(
    tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]["uqmbd"].values()
)


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_has_a_page(pages, module):
    # the stub of the results has an earlier name of `methods` for type checkers
    names = names_in_source(module) - {"__version__", "propagator_nodes"}
    assert names, "the list of public names was not found"
    assert [name for name in sorted(names) if f"{module}.{name}" not in pages] == []


def test_names_without_a_docstring_are_reported_where_they_are_assigned(pages):
    told = {name: text for name, text in pages.items() if "py:data" in text}
    assert len(told) > 10
    assert [name for name, text in told.items() if not text.rstrip().splitlines()[-1].strip()[:1].isalpha()] == []


def test_pages_differ_in_more_than_capitals(site):
    """Some systems of files do not tell capitals."""
    files = [path for module in MODULES for path in site.file_names(module).values()]
    assert len({path.lower() for path in files}) == len(files)


def test_every_study_has_a_page(site, tmp_path):
    gallery = importlib.import_module("uqmbd_site.gallery")
    (tmp_path / "docs").mkdir()
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    assert gallery.write_gallery(tmp_path / "docs", run=False) == []
    found = [*(ROOT / "studies").glob("*.py"), *(ROOT / "studies" / "published").glob("*.py")]
    index = (tmp_path / "docs" / "gallery" / "index.md").read_text(encoding="utf-8")
    for path in found:
        page = (tmp_path / "docs" / "gallery" / f"{path.stem}.md").read_text(encoding="utf-8")
        assert f"uqmbd run {path.relative_to(ROOT)}" in page and f":link: {path.stem}\n" in index


def test_a_site_without_runs_shows_stored_pictures(site, tmp_path):
    """Of every study; one that differs from the picture of a run is named."""
    gallery = importlib.import_module("uqmbd_site.gallery")
    source = tmp_path / "docs"
    shutil.copytree(ROOT / "docs" / "pictures", source / "pictures")
    (tmp_path / "studies").symlink_to(ROOT / "studies")
    gallery.write_gallery(source, run=False)
    index = (source / "gallery" / "index.md").read_text(encoding="utf-8")
    for name in gallery.studies(ROOT):
        picture = f"pictures/{name}-mechanism.png"
        assert (source / "gallery" / picture).exists() and f":img-top: {picture}" in index, name
        assert picture in (source / "gallery" / f"{name}.md").read_text(encoding="utf-8")
    run = source / "_build" / "studies" / "pendulum"
    run.mkdir(parents=True)
    stored = source / "pictures" / "pendulum-mechanism.png"
    shutil.copy(stored, run / "mechanism.png")
    assert gallery.changed_pictures(source) == []
    with Image.open(stored) as image:
        image.convert("RGB").rotate(90, fillcolor="white").save(run / "mechanism.png")
    assert gallery.changed_pictures(source) == ["pendulum-mechanism.png"]


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", text, re.M) == [importlib.import_module("uqmbd").__version__]


def test_a_component_page_has_its_figure_arguments_and_equations(pages):
    spring = pages["uqmbd_springs.SpringDamper"]
    assert "uqmbd_springs.SpringDamper.svg" in spring and "`uqmbd.Line`" in spring
    assert r"V = " in spring and r"\mathrm{stiffness}" in spring and "def terms(self, p" in spring


@pytest.mark.parametrize("name", sorted(plugins.components()))
def test_the_example_of_a_component_runs(site, pages, name):
    """It stands on the page of the component, and makes what the page draws."""
    component = plugins.component(name)
    components = importlib.import_module("uqmbd_site.components")
    code = components.example_code(component)
    assert all(line in pages[f"{component.__module__.partition('.')[0]}.{name}"] for line in code.splitlines())
    found = {}
    exec(compile(code, name, "exec"), found)
    drawn, shown = components.example_of(component)
    (made,) = found["mechanism"].components.values()
    assert str(made.values) == str(shown.values).replace("1/2", "0.5").replace("1/10", "0.1") and len(
        found["mechanism"].bodies
    ) == len(drawn.bodies)


def test_equations_of_a_component_are_what_it_states(site):
    """Of a distance in the plane: the square of the distance of two points less that of the length."""
    from uqmbd_joints import Distance

    components = importlib.import_module("uqmbd_site.components")
    (line,) = components.equations(Distance)
    for part in (r"r_{jx} - r_{ix}", r"r_{jy} - r_{iy}", r"\mathrm{length}^{2}", "0 ="):
        assert part in line


def components_of_plugins(site):
    names = importlib.import_module("uqmbd_site.names")
    found = [x for module in names.PLUGINS for x in names.public_names(module).values()]
    return [x for x in found if site.is_component(x)]


def test_every_component_shows_its_equations_in_rows_that_can_be_read(site):
    components = importlib.import_module("uqmbd_site.components")
    found = {x.__name__: components.equations(x) for x in components_of_plugins(site)}
    assert len(found) > 40 and [name for name, lines in found.items() if not lines] == []
    rows = {name: max(len(row) for line in lines for row in line.split(r" \\ ")) for name, lines in found.items()}
    assert {name: size for name, size in rows.items() if size > components.LONGEST} == {}


def test_named_parts_of_equations_are_what_they_stand_for(site):
    components = importlib.import_module("uqmbd_site.components")
    x, y, z = sympy.symbols("x y z", real=True)
    shared = x * y + x * z + y * z
    lines = [["0 =", shared * (1 + shared * sympy.sin(x))], ["V =", sympy.cos(shared)]]
    parts, shown = components.with_named_parts(lines, 6)
    assert len(parts) == 1 and [line[0] for line in shown] == ["0 =", "V ="]
    for whole, short in zip(lines, shown, strict=True):
        assert set(parts) <= short[1].free_symbols
        assert sympy.expand(short[1].subs(parts) - whole[1]) == 0


def test_objects_that_only_functions_return_are_reported(pages):
    text = pages["uqmbd.mechanism.bodies.body.Body"]
    assert "uqmbd.mechanism.bodies.body.Body" in text and "`uqmbd.Mechanism.body`" in text and "`uqmbd.check`" in text


def test_every_command_and_hook_is_reported(site, tmp_path):
    from uqmbd.plugins import KINDS

    interface = importlib.import_module("uqmbd_site.interface")
    interface.write_command_line(tmp_path)
    interface.write_hooks(tmp_path)
    folder = tmp_path / "reference" / "api"
    commands = (folder / "command_line.rst").read_text(encoding="utf-8")
    assert all(f"\nuqmbd {name}" in commands for name in KINDS["commands"].reserved)
    hooks = (folder / "hooks.rst").read_text(encoding="utf-8")
    assert all(kind.hook in hooks for kind in KINDS.values())

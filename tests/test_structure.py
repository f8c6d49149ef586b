"""The rules by which the code is laid out: how modules import each other, and how large folders and modules are.

Every import counts: those for types alone and those inside functions, too.  What layers lie above each other is said in
``pyproject.toml``, and checked by import-linter.
"""

import ast
import functools
import importlib.metadata
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

from uqmbd import plugins

ROOT = Path(__file__).parents[1]

MOST_MODULES = 18
"""Modules of one folder."""

MOST_LINES = 420
"""Lines of one module, unless its docstring has a paragraph that begins with ``Length:`` and says why."""

STATEMENTS = {
    "uqmbd": 1_120,
    "uqmbd.arguments": 560,
    "uqmbd.cli": 1_830,
    "uqmbd.clusters": 280,
    "uqmbd.compiled": 2_300,
    "uqmbd.dynamics": 16_240,
    "uqmbd.exchange": 240,
    "uqmbd.extend": 190,
    "uqmbd.mechanism": 5_670,
    "uqmbd.new": 231,
    "uqmbd.plugins": 475,
    "uqmbd.progress": 416,
    "uqmbd.propagation": 6_840,
    "uqmbd.randomness": 5_600,
    "uqmbd.report": 8_740,
    "uqmbd.results": 9_830,
    "uqmbd.testing": 2_820,
    "uqmbd.units": 285,
    "uqmbd.viewer": 740,
    "uqmbd_calibration": 3_430,
    "uqmbd_collocation": 4_190,
    "uqmbd_contact": 290,
    "uqmbd_drivers": 148,
    "uqmbd_fmi": 1_270,
    "uqmbd_galerkin": 820,
    "uqmbd_geometry": 730,
    "uqmbd_joints": 610,
    "uqmbd_models": 1620,
    "uqmbd_montecarlo": 1_320,
    "uqmbd_processes": 2_860,
    "uqmbd_flexible": 1_030,
    "uqmbd_pytest": 40,
    "uqmbd_reliability": 2_160,
    "uqmbd_springs": 510,
}
"""Statements of each package, at most: a commit that raises one of these numbers says why."""


def _modules():
    """Find all modules by their dotted names."""
    found = {}
    for base in (ROOT, ROOT / "plugins"):
        for package in sorted(p for p in base.glob("uqmbd*") if (p / "__init__.py").exists()):
            for path in package.rglob("*.py"):
                parts = path.relative_to(base).with_suffix("").parts
                found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = _modules()
PACKAGES = {name for name, path in MODULES.items() if path.name == "__init__.py"}


@functools.cache
def _trees():
    """Parse all modules, once, when the first test wants them: runs that only look for tests have no use for it."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


@functools.cache
def _face(package):
    """Find the names that a package exports."""
    lists = [
        node.value
        for node in _trees()[package].body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    ]
    return {x.value for found in lists for x in ast.walk(found) if isinstance(x, ast.Constant)}


def _imports(name):
    """Find the modules that a module imports, by whatever statement, with the lines."""
    package = name if name in PACKAGES else name.rpartition(".")[0]
    for node in ast.walk(_trees()[name]):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([base] if base else [])])
            whole = [f"{base}.{alias.name}" for alias in node.names]
            exported = _face(base) if base in PACKAGES else set()
            names = [x if x in MODULES and x.rpartition(".")[2] not in exported else base for x in whole]
        else:
            continue
        for other in dict.fromkeys(names):
            if other in MODULES and other != name:
                yield other, node.lineno


@functools.cache
def _all_imports():
    return {name: list(_imports(name)) for name in MODULES}


def _circles(graph):
    """Find sets of names that reach each other, by depth-first searches forth and back."""
    order, seen = [], set()
    for root in graph:
        stack = [(root, iter(graph[root]))] if root not in seen else []
        seen.add(root)
        while stack:
            node, rest = stack[-1]
            step = next((x for x in rest if x not in seen), None)
            if step is None:
                order.append(stack.pop()[0])
            else:
                seen.add(step)
                stack.append((step, iter(graph[step])))
    back = {name: [] for name in graph}
    for name, others in graph.items():
        for other in others:
            back[other].append(name)
    left, circles = set(graph), []
    for root in reversed(order):
        if root in left:
            found, todo = {root}, [root]
            while todo:
                fresh = [x for x in back[todo.pop()] if x in left and x not in found]
                found.update(fresh)
                todo += fresh
            left -= found
            circles += [found] if len(found) > 1 else []
    return circles


def test_the_search_for_circles_finds_them():
    graph = {"a": ["b"], "b": ["c"], "c": ["a", "d"], "d": ["e"], "e": [], "f": ["g"], "g": ["f"]}
    assert sorted(map(sorted, _circles(graph))) == [["a", "b", "c"], ["f", "g"]]


def test_no_module_imports_in_a_circle():
    # the face of the whole package names modules without importing them: its names are loaded when they are used
    graph = {name: [x for x, _ in _all_imports()[name] if x != "uqmbd"] for name in MODULES if name != "uqmbd"}
    assert not (found := _circles(graph)), "\n".join(", ".join(sorted(circle)) for circle in found)


def test_no_folder_imports_in_a_circle():
    wrong = []
    for package in sorted(PACKAGES):
        inside = [name for name in MODULES if name.startswith(package + ".")]
        depth = package.count(".") + 2
        graph = {".".join(name.split(".")[:depth]): set() for name in inside}
        for name in inside:
            mine = ".".join(name.split(".")[:depth])
            graph[mine] |= {
                theirs
                for other, _ in _all_imports()[name]
                if other.startswith(package + ".") and (theirs := ".".join(other.split(".")[:depth])) != mine
            }
        wrong += [", ".join(sorted(circle)) for circle in _circles(graph)]
    assert not wrong, "\n".join(wrong)


def test_a_folder_is_imported_through_its_face_only():
    wrong = []
    for name, others in _all_imports().items():
        for other, line in others:
            if other in PACKAGES:
                continue
            home = other.rpartition(".")[0]
            if home and home != "uqmbd" and not name.startswith(home + ".") and name != home:
                wrong.append(f"{name}:{line} imports {other}; import it from {home}")
    assert not wrong, "\n".join(wrong)


def test_plugins_import_what_is_public_only():
    public = {
        "uqmbd",
        "uqmbd.extend",
        "uqmbd.laws",
        "uqmbd.results",
        "uqmbd.report",
        "uqmbd.shapes",
        "uqmbd.testing",
        "uqmbd.typing",
    }
    wrong = [
        f"{name}:{line} imports {other}"
        for name, others in _all_imports().items()
        if not name.startswith("uqmbd.")
        for other, line in others
        if other.startswith("uqmbd.") and other not in public
    ]
    assert not wrong, "\n".join(wrong)


def _extras():
    """Find what only extras install, by the names under which it is imported."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    always = {re.split(r"[^\w-]", needed)[0] for needed in project["dependencies"]}
    extras = {re.split(r"[^\w-]", one)[0] for found in project["optional-dependencies"].values() for one in found}
    return {name.replace("-", "_") for name in extras - always - {"uqmbd"}}


def test_what_an_extra_installs_is_imported_where_it_is_used():
    """A module that needs it at its top could not even be imported without it."""
    extras = _extras()
    assert {"distributed", "mpi4py", "openturns", "emcee"} <= extras
    found = []
    for name, tree in _trees().items():
        for node in tree.body:
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            found += [f"{name} imports {m}" for m in modules if m.split(".")[0] in extras]
    # the kit for plugins' tests, and what pytest itself loads, run where pytest is
    assert [one for one in found if not one.startswith(("uqmbd.testing", "uqmbd_pytest"))] == []


WAIT = {
    "tests/clusters/conftest.py": "a scheduler that starts",
    "tests/propagation/execution/test_run_folder.py": "a process that ends",
    "tests/viewer/conftest.py": "a browser and the processes of a viewer",
}
"""Files of tests that look at a clock to give up what they wait for."""


def test_no_test_depends_on_measured_time():
    """Durations are counted (``tests/clock.py``); what is promised of times is in ``studies/benchmarks/promises.py``."""
    readers = "(perf_counter|process_time|monotonic|thread_time|time)(_ns)?"
    allowed = {"tests/clock.py", "tests/conftest.py", "tests/malformed/isolated.py", "tests/test_structure.py", *WAIT}
    for path in sorted((ROOT / "tests").rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        found = re.search(rf"\b(time|clock)\.{readers}\(|from time import (?!sleep)", path.read_text(encoding="utf-8"))
        assert found is None or name in allowed, (
            f"{name} reads a clock by {found[0]!r}; count what the time is spent on, or let tests/clock.py go on."
        )


PATCHING = {"setattr", "delattr", "getattr", "hasattr", "patch", "object", "attrgetter"}
"""Functions that reach attributes by names in texts: of Python, of pytest and of `unittest.mock`."""


def _is_private(name):
    return any(part.startswith("_") and not part.endswith("_") for part in name.split("."))


@functools.cache
def _private_names():
    """Find the private names that the code defines: functions, classes, variables, and attributes of objects."""
    found = set()
    for node in (node for tree in _trees().values() for node in ast.walk(tree)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.add(node.id if isinstance(node, ast.Name) else node.attr)
    return {name for name in found if _is_private(name)}


def _private_uses(source):
    """Find private names of the code that a test imports, reads or patches, with their lines."""
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names if alias.name.startswith("uqmbd") and _is_private(alias.name)]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("uqmbd"):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name for name in names if _is_private(name)]
        elif isinstance(node, ast.Attribute) and node.attr in _private_names():
            owner = ast.unparse(node.value)
            names = [] if owner in {"self", "cls", "super()"} else [f"{owner}.{node.attr}"]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in PATCHING:
            texts = [x.value for x in node.args if isinstance(x, ast.Constant) and isinstance(x.value, str)]
            names = [text for text in texts if _private_names() & set(text.split("."))]
        yield from ((node.lineno, name) for name in names)


@pytest.mark.parametrize(
    "line",
    [
        "from uqmbd.display import _entry_points",
        "import uqmbd.compiled._driver",
        "display._entry_points.cache_clear()",
        "monkeypatch.setattr('uqmbd.display._entry_points', dict)",
        "monkeypatch.setattr(display, '_entry_points', dict)",
        "with mock.patch.object(display, '_entry_points'): pass",
        "getattr(display, '_entry_points')()",
    ],
)
def test_the_search_for_private_names_finds_them(line):
    assert list(_private_uses(line))
    assert not list(_private_uses(line.replace("_entry_points", "html_of").replace("_driver", "driver")))


def test_tests_use_no_private_names():
    """A test states what callers rely on; a helper that needs a test of its own has a name without underscore."""
    wrong = [
        f"{path.relative_to(ROOT).as_posix()}:{line} uses {name}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for line, name in _private_uses(path.read_text(encoding="utf-8"))
    ]
    assert not wrong, "\n".join(wrong)


MISSPELT = {"uqmbd.Mechansim", "uqmbd.laws.lenght", "uqmbd.results.lode"}
"""Names in scripts of tests that are wrong on purpose."""


def _imported_in_texts(text: str) -> set[str]:
    """Names of the core that scripts in the strings of a module import: checkers do not read them."""
    strings = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)]
    found = re.findall(r"from (uqmbd(?:\.\w+)*) import ([\w, ]+)", "\n".join(x for x in strings if isinstance(x, str)))
    return {
        f"{module}.{one.split(' as ')[0].strip()}" for module, names in found for one in names.split(",") if one.strip()
    }


def test_scripts_in_strings_import_what_there_is():
    assert _imported_in_texts("RUN = 'from uqmbd.results import load, save as s; load()'") == {
        "uqmbd.results.load",
        "uqmbd.results.save",
    }
    wrong = []
    for path in sorted([*(ROOT / "tests").rglob("*.py"), *(ROOT / "studies").rglob("*.py")]):
        for name in sorted(_imported_in_texts(path.read_text(encoding="utf-8")) - MISSPELT):
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError):
                wrong.append(f"{path.relative_to(ROOT)}: {name}")
    assert not wrong, "\n".join(wrong)


def test_no_folder_is_crowded():
    counts = {package: 0 for package in PACKAGES}
    for name in MODULES:
        if name not in PACKAGES:
            counts[name.rpartition(".")[0]] += 1
    assert not {package: count for package, count in counts.items() if count > MOST_MODULES}


def test_no_module_is_long_without_a_reason():
    wrong = {}
    for name, path in MODULES.items():
        lines = len(path.read_text(encoding="utf-8").splitlines())
        if lines > MOST_LINES and "\n\nLength:" not in (ast.get_docstring(_trees()[name]) or ""):
            wrong[name] = lines
    assert not wrong


def test_no_function_is_named_like_its_module():
    """``from package import name`` would mean one or the other, depending on what was imported before."""
    assert [
        f"{name}:{node.lineno}"
        for name, tree in _trees().items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.strip("_") == name.rpartition(".")[2].strip("_")
    ] == []


def test_each_class_has_a_name_of_its_own():
    """A leading underscore makes no difference: readers search for the word."""
    found = {}
    for name, tree in _trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name.strip("_"), []).append(f"{name}:{node.lineno}")
    assert {name: places for name, places in found.items() if len(places) > 1} == {}


COMMON_WORDS = {"linear", "hertz", "reliability", "Reliability"}
"""Registered names that are words of messages as well."""

FORMATS = {"urdf", "mjcf"}
"""Formats of models that users name by functions of the core; the readers are plugins."""


def test_texts_of_the_core_name_no_plugin():
    """Messages name installed methods by their properties: see ``uqmbd/plugins/method_names.py``."""
    registry = plugins.load(importlib.metadata.entry_points(group="uqmbd"), ())
    names = {
        word for classes in registry.classes.values() for name, cls in classes.items() for word in (name, cls.__name__)
    }
    assert {"monte-carlo", "Collocation", "Revolute", "hunt-crossley"} <= names
    words = "|".join(map(re.escape, sorted(names - COMMON_WORDS - FORMATS)))
    named = re.compile(rf"(?<![\w.-])({words})(?![\w-])|(?i:\bmonte carlo\b|\bcollocation\b|\bgalerkin\b)")
    assert named.search("use Collocation(order=3)")
    wrong = []
    for name, tree in _trees().items():
        if name.partition(".")[0] != "uqmbd":
            continue
        texts = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in texts:
                wrong += [f"{name}:{node.lineno}: {found[0]}" for found in named.finditer(node.value)]
    assert not wrong, "\n".join(wrong)


def test_no_package_exceeds_its_budget_of_statements():
    found = dict.fromkeys(STATEMENTS, 0)
    for name, tree in _trees().items():
        parts = name.split(".")
        whole = ".".join(parts[:2])
        package = whole if parts[0] == "uqmbd" and whole in PACKAGES else parts[0]
        found[package] = found.get(package, 0) + sum(isinstance(node, ast.stmt) for node in ast.walk(tree))
    assert set(found) == set(STATEMENTS)
    assert {name: count for name, count in found.items() if count > STATEMENTS[name]} == {}


def test_nothing_of_the_project_is_imported_by_string():
    wrong = []
    for name, tree in _trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
                "import_module",
                "__import__",
            ):
                text = ast.unparse(node.args[0])
                if "uqmbd" in text:
                    wrong.append(f"{name}:{node.lineno} {text}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", sorted(p for p in PACKAGES if "." not in p))
def test_every_package_tells_its_types(package):
    assert (MODULES[package].parent / "py.typed").exists()

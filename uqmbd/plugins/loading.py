"""Loading of plugins: each plugin is examined separately, and a message with its name reports unusable parts."""

from __future__ import annotations

import importlib.metadata
import inspect
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import pluggy

from uqmbd.isolation import Isolated, last_line
from uqmbd.names import lineage
from uqmbd.plugins.hooks import GROUP, KINDS, HookKind, plugin_manager

__all__ = ["PluginInfo", "Registry", "load", "merged", "core_offers", "registered_name"]


@dataclass(frozen=True)
class PluginInfo:
    """Plugin, loaded from the entry points with one name and distribution, and its status."""

    name: str  # name of the entry point
    # distribution, version: name and version of the installed package; empty if unknown
    distribution: str
    version: str
    # ``"incomplete"``: some parts of the plugin could not be used, other parts are available
    status: Literal["loaded", "incomplete", "failed", "disabled"] = "loaded"
    hooks: tuple[str, ...] = ()  # hooks that the plugin implements
    # components, propagators, integrators, designs, contact_laws, readers, report_sections, checks, surrogates,
    # exporters, commands: registered names of the plugin
    components: tuple[str, ...] = ()
    propagators: tuple[str, ...] = ()
    integrators: tuple[str, ...] = ()
    designs: tuple[str, ...] = ()
    contact_laws: tuple[str, ...] = ()
    readers: tuple[str, ...] = ()
    report_sections: tuple[str, ...] = ()
    checks: tuple[str, ...] = ()
    surrogates: tuple[str, ...] = ()
    exporters: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()  # reasons why the plugin or parts of it cannot be used

    @property
    def title(self) -> str:
        """Name and distribution of the plugin, for messages."""
        source = f"{self.distribution} {self.version}".strip() or "an unknown distribution"
        return f"plugin {self.name!r} of {source}"


@dataclass(frozen=True)
class Registry:
    """Classes of the installed plugins, by kind and registered name."""

    plugins: tuple[PluginInfo, ...]
    classes: dict[str, dict[str, type]]


def load(
    entry_points: Iterable[importlib.metadata.EntryPoint], disabled: Sequence[str] = (), group: str = GROUP
) -> Registry:
    """Load plugins from entry points; every failure becomes an entry of `PluginInfo.errors`.

    The plugins of uqmbd are registered first, then other plugins by distribution and name. So the owner of a name does
    not depend on the order of installation. `disabled` contains names of entry points or distributions that are not
    loaded. `group` is the group of the entry points, which determines their permitted hooks.
    """
    manager = plugin_manager()
    classes: dict[str, dict[str, type]] = {kind: {} for kind in KINDS}
    owners: dict[tuple[str, str], str] = {}
    skip = {_normalised(name) for name in disabled}
    described = [(_describe(entry_point), entry_point) for entry_point in entry_points]
    described.sort(key=lambda pair: (pair[0].distribution != "uqmbd", pair[0].distribution, pair[0].name))
    plugins = []
    for info, entry_point in described:
        if skip & {_normalised(info.name), _normalised(info.distribution)}:
            plugins.append(_replace(info, status="disabled"))
        else:
            plugins.append(_load_one(manager, info, entry_point, group, classes, owners))
    return Registry(tuple(plugins), classes)


def core_offers(implementation: object, kind: str) -> dict[str, type]:
    """Return the classes of the core for a kind, after the same checks as for a plugin.

    `implementation` implements the hook.
    """
    manager = plugin_manager()
    manager.register(implementation)
    offered, problems = _call(manager, implementation, KINDS[kind]._replace(reserved=()))
    assert not problems, problems
    return dict(offered)


def _load_one(
    manager: pluggy.PluginManager,
    info: PluginInfo,
    entry_point: importlib.metadata.EntryPoint,
    group: str,
    classes: dict[str, dict[str, type]],
    owners: dict[tuple[str, str], str],
) -> PluginInfo:
    """Register one plugin and add its classes to `classes`; a failure of a plugin does not affect other plugins."""
    plugin: object = None
    names: tuple[str, ...] = ()
    with Isolated() as work:
        plugin = entry_point.load()
    if work.error is not None:
        return _replace(info, status="failed", errors=(f"it cannot be loaded: {last_line(work.error)}",))
    with Isolated() as work:
        # The key contains the distribution, because entry points of two packages may have the same name.
        manager.register(plugin, name=f"{info.distribution}:{info.name}")
        names = tuple(sorted(caller.name for caller in manager.get_hookcallers(plugin) or ()))
    if work.error is not None:
        return _replace(info, status="failed", errors=(f"it is not a valid plugin: {last_line(work.error)}",))
    known = {kind.hook for kind in KINDS.values() if kind.group == group}
    hooks = tuple(name for name in names if name in known)
    errors = [_misplaced(name, entry_point, known) for name in names if name not in known]
    plain = sorted(name for name in known - set(names) if inspect.isfunction(vars(plugin).get(name)))
    if names and plain:
        errors.append(f"its function {plain[0]} is not decorated with uqmbd.hookimpl, so its hook is unknown")
    if not names:
        listed = ", ".join(sorted(known))
        errors.append(
            f"{entry_point.value} does not implement a hook; decorate its functions ({listed}) with uqmbd.hookimpl"
        )
    registered: dict[str, tuple[str, ...]] = {}
    for kind_name, kind in KINDS.items():
        if kind.hook not in hooks:
            continue
        offered, problems = _call(manager, plugin, kind)
        errors.extend(problems)
        accepted = []
        for name, cls in offered:
            owner = owners.setdefault((kind_name, name), info.title)
            if name in classes[kind_name]:
                errors.append(f"the {kind.noun} name {name!r} is already taken by the {owner}")
            else:
                classes[kind_name][name] = cls
                accepted.append(name)
        registered[kind_name] = tuple(accepted)
    usable = any(registered.values())
    status = "loaded" if not errors else ("incomplete" if usable else "failed")
    return _replace(info, status=status, hooks=hooks, errors=tuple(errors), **registered)


def _misplaced(hook: str, entry_point: importlib.metadata.EntryPoint, known: set[str]) -> str:
    """Return the message on a hook that does not belong to the group of an entry point."""
    group = next((kind.group for kind in KINDS.values() if kind.hook == hook), None)
    if group is None:
        return f"it implements the hook {hook}, which does not exist; there are {', '.join(sorted(known))}"
    return (
        f"it implements the hook {hook}, which belongs in a module of the entry-point group {group!r}: "
        f'in pyproject.toml [project.entry-points."{group}"] {entry_point.name} = "MODULE"'
    )


def _call(manager: pluggy.PluginManager, plugin: object, kind: HookKind) -> tuple[list[tuple[str, type]], list[str]]:
    """Call one hook of one plugin; return usable classes with their names, and messages on unusable classes."""
    others = [other for other in manager.get_plugins() if other is not plugin]
    result: Any = None
    listed: list[Any] | None = None
    with Isolated() as work:
        results = manager.subset_hook_caller(kind.hook, remove_plugins=others)()
        # pluggy omits hooks that return None, for example because of a forgotten `return`
        result = results[0] if results else None
        if isinstance(result, (list, tuple, set, frozenset)):
            listed = list(result)
    if work.error is not None:
        return [], [f"its hook {kind.hook} raised {last_line(work.error)}"]
    if listed is None:
        return [], [f"its hook {kind.hook} returned {_short(result)}; a sequence of classes is expected"]
    offered, problems = [], []
    for cls in listed:
        name, problem = "", ""
        with Isolated() as work:
            name, problem = registered_name(cls, kind)
        if work.error is not None:
            problem = f"which raised {last_line(work.error)} when uqmbd inspected it"
        if problem:
            problems.append(f"its hook {kind.hook} returned {_short(cls)}, {problem}")
        else:
            offered.append((name, cls))
    return offered, problems


def registered_name(cls: Any, kind: HookKind) -> tuple[str, str]:
    """Return the registered name of a class, and the reason why it cannot be registered or an empty text."""
    if not inspect.isclass(cls):
        return "", "which is not a class"
    if kind.base is not None:
        package, base = kind.base.partition(".")[0], kind.base.rpartition(".")[2]
        if f"{package}.{base}" not in lineage(cls):
            return "", f"which is not a subclass of {kind.base}"
        if inspect.isabstract(cls):
            missing = ", ".join(sorted(getattr(cls, "__abstractmethods__", ())))
            return "", f"which is abstract: it does not define {missing}"
    if kind.method and not callable(getattr(cls, kind.method, None)):
        return "", f"which has no method {kind.method!r}"
    if not kind.by_attribute:
        return cls.__name__, ""
    name = getattr(cls, "name", None)
    # only the type str itself: comparisons of a subclass may run any code
    if type(name) is not str or not name or "/" in name:
        return "", "whose class attribute `name` is not a string without '/', such as \"my-method\""
    if name in kind.reserved:
        article = "an" if kind.noun[0] in "aeiou" else "a"
        return name, f"whose name {name!r} is that of {article} {kind.noun} of uqmbd"
    for flag in kind.flags:
        if not isinstance(getattr(cls, flag, False), bool):
            return name, f"whose class attribute `{flag}` is {_short(getattr(cls, flag))}; True or False is expected"
    return name, "" if kind.problem is None else kind.problem(cls)


def _describe(entry_point: importlib.metadata.EntryPoint) -> PluginInfo:
    """Return the name of a plugin and its distribution; the metadata of a damaged installation may be missing."""
    distribution = version = ""
    with Isolated():  # describe the plugin by the available metadata
        if entry_point.dist is not None:
            distribution = entry_point.dist.metadata["Name"] or ""
            version = entry_point.dist.metadata["Version"] or ""
    return PluginInfo(entry_point.name, distribution, version)


def merged(infos: Iterable[PluginInfo]) -> tuple[PluginInfo, ...]:
    """Merge the descriptions of entry points with the same name and distribution."""
    found: dict[tuple[str, str], PluginInfo] = {}
    for info in infos:
        key = (info.distribution, info.name)
        other = found.get(key)
        if other is None:
            found[key] = info
            continue
        lists = {name: value + getattr(info, name) for name, value in vars(other).items() if isinstance(value, tuple)}
        same = other.status == info.status
        found[key] = _replace(other, **lists, status=other.status if same else "incomplete")
    return tuple(found.values())


def _replace(info: PluginInfo, **changes: Any) -> PluginInfo:
    return PluginInfo(**{**vars(info), **changes})


def _normalised(name: str) -> str:
    """Return the normalised name of a distribution, as in package indices.

    >>> _normalised("Uqmbd_Example.Plugin")
    'uqmbd-example-plugin'
    """
    return re.sub(r"[-_.]+", "-", name).lower()


def _short(value: object) -> str:
    text = f"an object of type {type(value).__name__} that cannot be shown"
    with Isolated():
        text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."

"""Show results in notebooks, by a function or automatically in sessions with the extension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uqmbd.arguments import typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.report.notebook.objects import result_html

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Shown", "load_ipython_extension", "show", "unload_ipython_extension"]


@typechecked
@dataclass(frozen=True)
class Shown:
    """Displayed content of a notebook cell, the result of :func:`show`.

    Attributes
    ----------
    html : str
        HTML with its scripts; it loads no external data.

    Examples
    --------
    >>> from uqmbd.report import Shown
    >>> Shown("<p>height: 3.0 m</p>")._repr_html_()
    '<p>height: 3.0 m</p>'
    """

    html: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return f"<shown in notebooks: {len(self.html)} characters of HTML>"


@typechecked
def show(result: object, outputs: Sequence[str] | None = None) -> Shown:
    """Show the result of a study in a notebook, with the charts of the report.

    Parameters
    ----------
    result : xarray.DataTree
        Result of a study, or of one method. Studies, mechanisms and surrogates, which notebooks display automatically,
        are also accepted.
    outputs : sequence of str, optional
        Drawn outputs of a result. Default: the six most uncertain outputs.

    Returns
    -------
    Shown
        Object that notebooks display if it is the last value of a cell; its ``html`` is a text.

    Raises
    ------
    StudyError
        If the object cannot be shown, or lacks an output.

    See Also
    --------
    load_ipython_extension : Show results automatically.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> show(node).html.count('<figure class="charted">')
    1
    """
    import xarray as xr

    if isinstance(result, xr.DataTree):
        return Shown(result_html(result, outputs))
    if outputs is not None:
        raise StudyError(f"show() has outputs={outputs!r}, which only results have; got a {type(result).__name__}.")
    html = html_of(result)
    if html is None:
        raise StudyError(
            f"show() got a {type(result).__name__}; expected the result of a study (xarray.DataTree), a study, a "
            "mechanism or a surrogate."
        )
    return Shown(html)


def load_ipython_extension(ipython: Any) -> None:
    """Show results of studies automatically in this IPython session, after ``%load_ext uqmbd.report``.

    The display of other xarray trees does not change.

    Parameters
    ----------
    ipython : IPython.core.interactiveshell.InteractiveShell
        IPython session.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> known = {}
    >>> formatter = SimpleNamespace(for_type=known.__setitem__, pop=known.pop)
    >>> session = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": formatter}))
    >>> load_ipython_extension(session)
    >>> [kind.__name__ for kind in known]
    ['DataTree']
    """
    import xarray as xr

    ipython.display_formatter.formatters["text/html"].for_type(xr.DataTree, _tree_html)


def unload_ipython_extension(ipython: Any) -> None:
    """Show results as xarray trees again, after ``%unload_ext uqmbd.report``.

    Parameters
    ----------
    ipython : IPython.core.interactiveshell.InteractiveShell
        IPython session.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> left = {}
    >>> formatter = SimpleNamespace(pop=left.pop)
    >>> session = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": formatter}))
    >>> unload_ipython_extension(session)  # nothing was loaded
    """
    import xarray as xr

    ipython.display_formatter.formatters["text/html"].pop(xr.DataTree, None)


def _tree_html(tree: xr.DataTree) -> str:
    from uqmbd.results import propagator_nodes

    if propagator_nodes(tree):
        return result_html(tree)
    own: str = tree._repr_html_()  # type: ignore[no-untyped-call]
    return own

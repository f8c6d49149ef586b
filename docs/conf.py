"""How the site is built: ``sphinx-build -W --keep-going -n docs docs/_build/html``, without a network."""

from __future__ import annotations

import os
import sys
from importlib.metadata import files
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent), str(HERE.parent / "plugins")]
# blocks that are executed find the sources, and draw without a screen
os.environ["PYTHONPATH"] = os.pathsep.join([*sys.path[1:3], os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
os.environ.setdefault("MPLBACKEND", "Agg")
# kernels of executed pages show figures as they are returned, sharp at any size
KERNELS = HERE / "_build" / "ipython"
(KERNELS / "profile_default").mkdir(parents=True, exist_ok=True)
(KERNELS / "profile_default" / "ipython_kernel_config.py").write_text(
    'c.IPKernelApp.matplotlib = "inline"\nc.InlineBackend.figure_formats = {"svg"}\n'
)
os.environ["IPYTHONDIR"] = str(KERNELS)

import uqmbd  # noqa: E402  # behind the path


def _mathjax() -> str:
    """Return the file of MathJax that draws formulas as SVG, without fonts of its own: it works from files, offline."""
    (found,) = [path for path in files("sphinx-mathjax-offline") or [] if path.name == "tex-svg-full.js"]
    return str(found.locate())


project = "uqmbd"
author = "The uqmbd authors"
copyright = author
version = release = uqmbd.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "uqmbd_site",
]
exclude_patterns = ["_build", "_ext", "**/.ipynb_checkpoints"]
nitpicky = True
suppress_warnings = ["toc.empty_glob"]

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "executed")
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

# What a docstring names in single backticks is linked if it is public, else shown as code: see uqmbd_site.links.
default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
# a method stands in the list of its page without the name of its class
toc_object_entries_show_parents = "hide"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

# pydata-sphinx-theme, not furo: the kinds of pages stand side by side in its bar, as at NumPy, and tables have room;
# furo has all pages in one column.
html_theme = "pydata_sphinx_theme"
html_title = f"uqmbd {release}"
html_static_path = ["_static", _mathjax()]
(HERE / "_build" / "extra").mkdir(parents=True, exist_ok=True)
html_extra_path = ["_build/extra"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": True,
    "header_links_before_dropdown": 7,
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
mathjax_path = "tex-svg-full.js"

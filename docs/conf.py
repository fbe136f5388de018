"""Sphinx configuration: MyST pages, autodoc of the public interface, executed gallery, furo."""

from __future__ import annotations

import re
from importlib.metadata import distribution
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

from sphinx.util.display import status_iterator

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.app.commands.explore import scene_units

project = "ballpass"
author = "the ballpass authors"
project_copyright = "2026, the ballpass authors"
release = version = installed_version("ballpass")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "gallery", "auto_gallery/*.ipynb"]
html_theme = "furo"
html_title = f"ballpass {release}"
html_css_files = ["site.css"]

# one file that has TeX input, SVG output and the letters in it: formulas show without a network
_MATHJAX = "tex-svg.js"
_MATHJAX_WHEEL = "sphinx-mathjax-offline"
html_static_path = [
    "static",
    str(distribution(_MATHJAX_WHEEL).locate_file(f"{_MATHJAX_WHEEL}/static/mathjax/{_MATHJAX}")),
]
mathjax_path = _MATHJAX

copybutton_prompt_text = "$ "
copybutton_line_continuation_character = "\\"

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "abort_on_example_error": True,
    "within_subsection_order": "FileNameSortKey",
    "first_notebook_cell": "%matplotlib inline",
    "min_reported_time": 1000,
    "write_computation_times": False,  # a page that takes scripts from elsewhere
    "remove_config_comments": True,
    "reset_modules": ("matplotlib", "ballpass.runtime.plot.style.use"),
}

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

# words of signatures that name several things, as two classes Statistics: a link to either would do
suppress_warnings = ["ref.python"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types of other packages, and of modules without a page
default_role = "code"  # single backquotes in docstrings are names
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_mock_imports = ["torch"]  # 750 MB for one docstring
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True  # attributes of records as a list, not as objects that autodoc lists again
napoleon_use_rtype = False

_SECTION = re.compile(r"^(Parameters|Attributes)$")
_ENTRY = re.compile(r"^(\w+(?:, \w+)*) : (.*)$")


def describe_entries(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Move the text behind ``name :`` to a line of its own.

    Types stand in the signatures here, so that the place numpydoc keeps for the type holds the description.
    """
    if what in ("property", "attribute"):
        lines.insert(0, "")  # else napoleon takes the first line's words in front of a colon for a type
    inside = False
    rewritten: list[str] = []
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if following and set(following) == {"-"}:
            inside = bool(_SECTION.match(line))
        entry = _ENTRY.match(line) if inside else None
        if entry is None:
            rewritten.append(line)
        else:
            rewritten += [entry[1], f"    {entry[2]}"]
    lines[:] = rewritten


def write_live_pages(app: Any) -> None:
    """A page with the solver in it for each scene that comes with ballpass, beside the others of the site."""
    if app.builder.format != "html":
        return
    folder = Path(app.outdir) / "live"
    folder.mkdir(parents=True, exist_ok=True)
    scenes = shipped_scenes()
    # named one by one, as Sphinx names its pages: the first time each is compiled for browsers
    for name in status_iterator(scenes, "writing live pages... ", "brown", len(scenes)):
        scene = scenes[name]
        model = load(generate(scene))
        model.explore(folder / f"{scene.stem}.html", units=scene_units(scene, model.manifest))


def setup(app: Any) -> None:
    app.connect("builder-inited", write_live_pages)
    # before napoleon, which listens with the default priority of 500
    app.connect("autodoc-process-docstring", describe_entries, priority=400)

"""Sphinx's configuration of the site, for `make docs`: warnings are errors, no network is used."""

from __future__ import annotations

import sys
from importlib.metadata import metadata
from importlib.util import find_spec
from pathlib import Path

from sphinx.application import Sphinx

import pteron

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "extensions"))

from figures import FigureScraper  # noqa: E402

project = "Pteron"
author = "The Pteron authors"
project_copyright = author
version = release = pteron.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",
    "sphinx_copybutton",
    "sphinxcontrib.bibtex",
    "command_line",
    "descriptions",
    "equations",
    "for_everyone",
    "handed_out",
    "linked_names",
    "machine_cards",
    "reference",
    "results",
    "sources",
    "topics",
]
exclude_patterns = [
    "_build",
    "_templates",
    "pictures",
    "extensions",
    "gallery/**/*.ipynb",
    "gallery/**/*.py",
]
nitpicky = True
nitpick_ignore_regex = [("py:(obj|class)", "(?s:.*)"), ("py:exc", r"\w+Error|NoSquareRoot")]
"""A word in backticks, or a type, is a link where it is a public name, and else a word."""

# Pages.
html_theme = "furo"
html_title = "Pteron"
html_favicon = html_logo = "_static/icon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["frames.js"]
templates_path = ["_templates"]
html_search_scorer = str(DOCS / "_static" / "search-order.js")
# An arrow key in code that scrolls is meant for the code.
html_theme_options = {"navigation_with_keys": False}
html_sidebars = {
    "**": [
        *("sidebar/brand.html", "sidebar/version.html", "sidebar/search.html"),
        *("sidebar/scroll-start.html", "sidebar/navigation.html", "sidebar/scroll-end.html"),
    ]
}
# Repository and issues, where whoever publishes has set them in pyproject.toml.
html_context = {
    "project_urls": [url.split(", ") for url in metadata("pteron").get_all("Project-URL") or []]
}
html_copy_source = False
html_show_sphinx = False
toc_object_entries_show_parents = "hide"
suppress_warnings = ["config.cache"]

# Markdown and notebooks.
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "html_image"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_selector = "div:not(.output) > div.highlight pre"  # not what a notebook prints
copybutton_exclude = ".linenos, .gp, .go, .gt, .gr, .ne"

# Reference.
default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "groupwise"
autodoc_default_options = {"members": True}
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_preprocess_types = False
viewcode_line_numbers = True
python_use_unqualified_type_names = True

# Theory.
math_eqref_format = "({number})"
math_numfig = False
numfig = False
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

# The gallery.
GALLERY = DOCS.parent / "examples" / "gallery"
if GALLERY.is_dir() and find_spec("sphinx_gallery") is not None:
    extensions.append("sphinx_gallery.gen_gallery")
    sphinx_gallery_conf = {
        "examples_dirs": str(GALLERY),
        "gallery_dirs": "gallery",
        # Pages of functions show the examples that call them.
        "backreferences_dir": "gallery/backreferences",
        "doc_module": ("pteron",),
        "filename_pattern": r"/plot_",
        "image_scrapers": (FigureScraper(),),
        "abort_on_example_error": True,
        "only_warn_on_example_error": False,
        "download_all_examples": False,
        "remove_config_comments": True,
        "write_computation_times": False,
        "show_memory": False,
        "show_signature": False,
        "capture_repr": ("_repr_html_",),
        "default_thumb_file": str(DOCS / "catalog" / "delta.png"),  # of a film
    }


def leave_out(app: Sphinx, page: str, source: list[str]) -> None:
    """Leave the gallery out of the contents where there are no examples."""
    if page == "index" and "gallery/index" not in app.env.found_docs:
        source[0] = source[0].replace("\ngallery/index\n", "\n")


def setup(app: Sphinx) -> None:
    """Tell Sphinx."""
    app.connect("source-read", leave_out)

"""The reference: pages of everything public, written from what the package says of itself.

A function that no topic names comes under "More", a module of `_PUBLIC` gets a page of its
own, so that nothing public is left out.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from inspect import cleandoc
from itertools import groupby
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.python import ObjectEntry, PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.ext import autosummary
from sphinx.pycode import ModuleAnalyzer
from sphinx.transforms import SphinxTransform

import pteron
from pteron import dynamics

TOPICS: dict[str, tuple[str, ...]] = {
    "Robots": ("load", "save", "catalog", "Manipulator", "turned", "working_modes"),
    "Parameters": (
        *("parameters", "parameter_names", "with_parameters"),
        *("base_parameters", "base_regressor"),
    ),
    "Kinematics": (
        *("inverse_kinematics", "direct_kinematics", "follow", "jacobian", "random_poses"),
        *("pose_of", "rotation_of", "twist"),
    ),
    "Dynamics": (
        *("inverse_dynamics", "forward_dynamics", "regressor", "drive_forces"),
        *("drive_accelerations", "mass_matrix", "bias_forces", "coriolis_matrix"),
        *("gravity_forces", "kinetic_energy", "potential_energy"),
    ),
    "Code": ("compile", "export_c", "export_st"),
    "Errors": (
        *("PteronError", "ModelError", "UnreachablePose", "SingularPose", "DataError"),
        *("OutputError", "UnlikelyValue"),
    ),
}
"""Names on each page, in order."""

INSIDE = {
    "equations": "The paper, as expressions: [the theory](../../theory/index.md) links here.",
    "legs": "One file for each kind of leg; read [how to write one](../../how-to/own-leg.md).",
    "closures": "How the legs' rows make up the Jacobian, and back.",
    "platforms": "One file for each kind of platform.",
    "bodies": "Vectors, inertia, parameters, and a body in motion.",
    "indices": "How good a pose is: the parts of `pteron.indices`.",
    "reduction": "Which parameters count: the parts of `pteron.reduction`.",
    "kinematics": "The modules that compute poses, joint coordinates, modes and singularities.",
}
"""Packages whose parts have a page, for those who read on."""


def directive_for(value: object) -> str:
    """Return which directive documents a thing."""
    if inspect.isclass(value):
        return "autoexception" if issubclass(value, BaseException) else "autoclass"
    return "autofunction" if callable(value) else "autodata"


_PUBLIC: list[str] = vars(pteron)["__all__"]
"""All public names of the package."""


def by_topic() -> dict[str, tuple[str, ...]]:
    """Return the public names by page."""
    named = {name for names in TOPICS.values() for name in names}
    modules = {name for name in _PUBLIC if isinstance(getattr(pteron, name), ModuleType)}
    found = {
        topic: tuple(name for name in names if name in _PUBLIC) for topic, names in TOPICS.items()
    }
    rest = tuple(name for name in _PUBLIC if name not in named | modules)
    return found | ({"More": rest} if rest else {})


def public_modules() -> list[ModuleType]:
    """Return the modules that `pteron` exports, and others with public names of their own."""
    values = [getattr(pteron, name) for name in _PUBLIC]
    return [*(value for value in values if isinstance(value, ModuleType)), dynamics]


def parts(package: str) -> list[str]:
    """Return the modules of a package, by their full names."""
    whole = import_module(f"pteron.{package}")
    return sorted(f"{whole.__name__}.{part.name}" for part in iter_modules(whole.__path__))


def _documented(owner: ModuleType, names: Iterable[str]) -> list[str]:
    """Return the lines that list names of a module, and then tell about each."""
    lines = _listed(owner, names)
    for name in names:
        lines += [f".. {directive_for(getattr(owner, name))}:: {name}", ""]
    return lines


def _listed(owner: ModuleType, names: Iterable[str]) -> list[str]:
    """Return the lines of a table of names."""
    lines = [f".. currentmodule:: {owner.__name__}", "", ".. autosummary::", ""]
    return lines + [f"   {name}" for name in names] + [""]


def _page(title: str, lines: list[str]) -> str:
    return "\n".join([f"# {title}", "", "```{eval-rst}", *lines, "```", ""])


def _pages_of_module(module: ModuleType, places: dict[str, str]) -> dict[str, str]:
    """Return the page of a module, with a list, and a page for each of its names.

    A class that two modules hand on has one page: `places` are those of the modules before. What a
    module inside has the name of is indexed there.
    """
    inside = {part for package in INSIDE for part in parts(package)}
    short = module.__name__.removeprefix("pteron.")
    public = sorted((name for name in module.__all__ if name not in _PUBLIC), key=str.lower)
    pages, listed = {}, []
    # A function and its result may have names that are one file's where letters have no case.
    for _, group in groupby(public, str.lower):
        lines, names = [f".. currentmodule:: {module.__name__}", ""], []
        for name in group:
            value = getattr(module, name)
            full = f"{module.__name__}.{name}"
            place = f"{value.__module__}.{name}" if inspect.isclass(value) else full
            first = places.setdefault(place, full)
            listed.append(name if first == full else f"~{first}")
            if first == full:
                names.append(name)
                again = ["   :no-index:"] if full in inside else []
                lines += [f".. {directive_for(value)}:: {name}", *again, ""]
        if names:
            lines += [f".. minigallery:: {module.__name__}.{names[-1]}", ""]
            page = _page(", ".join(f"`{name}`" for name in names), lines)
            pages[f"modules/{short}/{names[-1]}.md"] = (
                f"---\norphan: true\n---\n\n{page}\n"
                f"Module: [`{module.__name__}`](../{short}.md), with all its names.\n"
            )
    lines = [f".. automodule:: {module.__name__}", "   :no-members:", "", *_listed(module, listed)]
    return {f"modules/{short}.md": _page(f"`{module.__name__}`", lines)} | pages


def pages() -> dict[str, str]:
    """Return the pages in Markdown by where they stand in reference/."""
    found: dict[str, str] = {}
    places: dict[str, str] = {}
    for topic, names in by_topic().items():
        found[f"functions/{topic.lower()}.md"] = _page(topic, _documented(pteron, names))
    for module in public_modules():
        found |= _pages_of_module(module, places)
    for package, intro in INSIDE.items():
        text = [f"# Inside `pteron.{package}`", "", intro, ""]
        for part in parts(package):
            text += [f"## `{part.removeprefix('pteron.')}`", "", "```{eval-rst}"]
            text += [f".. automodule:: {part}", "   :members:", "```", ""]
        found[f"inside/{package}.md"] = "\n".join(text)
    return found


def write_pages(app: Sphinx) -> None:
    """Write the pages that have changed, and remove those that are no more."""
    folder = app.srcdir / "reference"
    wanted = pages()
    for part in ("functions", "modules", "inside"):
        for old in (folder / part).rglob("*.md"):
            if old.relative_to(folder).as_posix() not in wanted:
                old.unlink()
    for name, text in wanted.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


_BAR = re.compile(r"(`[^`]*`)|\|")
_VALUES = ("attribute", "data", "property")


def whole_values(
    app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]
) -> None:
    """Keep what is said of a value whole: napoleon takes "(n, 1): m or rad" for a type."""
    if what in _VALUES and lines:
        lines[0] = lines[0].replace(":", _COLON)


def said_where_defined(
    app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]
) -> None:
    """Take what is said of a value that a package hands on from the module that defines it.

    Else it is what Python says of dictionaries, or of tuples.
    """
    if what != "data" or lines[:1] != cleandoc(type(thing).__doc__ or "").splitlines()[:1]:
        return
    package, _, last = name.rpartition(".")
    lines.clear()
    for module in sorted(part for part in sys.modules if part.startswith(f"{package}.")):
        if getattr(sys.modules[module], last, None) is thing:
            said = ModuleAnalyzer.for_module(module).find_attr_docs().get(("", last))
            lines += said or []
            if said:
                return


def plain_bars(
    app: Sphinx, what: str, name: str, thing: object, options: Any, lines: list[str]
) -> None:
    """Keep |w|, a length in plain text, from being read as markup."""
    lines[:] = [
        line if line.lstrip().startswith((">>>", "...")) else _BAR.sub(_without_meaning, line)
        for line in (line.replace(_COLON, ":") for line in lines)
    ]


_COLON = "\N{RATIO}"
"""Stands for a colon while napoleon reads."""


def _without_meaning(found: re.Match[str]) -> str:
    return found[1] or "\\|"


def without_aliases(
    app: Sphinx, what: str, name: str, thing: object, skip: bool, options: Any
) -> bool | None:
    """Leave out fields of named tuples that say no more than their number."""
    said = getattr(thing, "__doc__", None) or ""
    return True if said.startswith("Alias for field number") else None


class OneDocument(SphinxTransform):
    """Give every node the page as its document.

    Nodes of `eval-rst` come from a document of their own, whose settings hold the whole
    environment: it would be stored with each page, 20 MB and a second every time.
    """

    default_priority = 999

    def apply(self, **kwargs: Any) -> None:
        """Set the document of each node."""
        for node in self.document.findall():
            node.document = self.document


class Names(PythonDomain):
    """Names in docstrings: exactly, in their class or module, or as pteron's public names.

    Of others a class, or a name with a dot, is found by its end; a word like `value` is a word.
    """

    def find_obj(
        self,
        env: BuildEnvironment,
        modname: str | None,
        classname: str | None,
        name: str,
        type: str | None,  # noqa: A002
        searchmode: int = 0,
    ) -> list[tuple[str, ObjectEntry]]:
        """Return the one thing that a name means, if there is one."""
        name = name.removesuffix("()").removeprefix("pteron.")
        places = (f"{modname}.{classname}", f"{modname}", f"pteron.{classname}", "pteron")
        found = [f"{place}.{name}" for place in places]
        if "." in name or name[:1].isupper():
            found += sorted((n for n in self.objects if n.endswith(f".{name}")), key=len)
        return [(full, self.objects[full]) for full in found if full in self.objects][:1]


# What does not end the first sentence of a docstring.
setattr(  # noqa: B010
    autosummary,
    "WELL_KNOWN_ABBREVIATIONS",
    (*autosummary.WELL_KNOWN_ABBREVIATIONS, "Eq.", "Eqs."),
)


_SIDEBARS: dict[tuple[Sphinx, int], Callable[..., str]] = {}
"""The sidebars of pages that stand in no table of contents, by the depth of their folder."""


def share_sidebar(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Compute the sidebar once for all pages of single names, and of sources, of one depth."""
    depth = page.count("/")
    if page.startswith("_modules/") or (page.startswith("reference/modules/") and depth == 3):
        key = (app, -depth if page.startswith("_modules/") else depth)
        context["toctree"] = _SIDEBARS.setdefault(key, cache(context["toctree"]))


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.connect("html-page-context", share_sidebar, priority=400)
    app.connect("builder-inited", write_pages)
    app.connect("autodoc-process-docstring", said_where_defined, priority=440)
    app.connect("autodoc-process-docstring", whole_values, priority=450)
    app.connect("autodoc-process-docstring", plain_bars, priority=550)
    app.connect("autodoc-skip-member", without_aliases)
    app.add_transform(OneDocument)
    app.add_domain(Names, override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""What is kept on disk between processes is never the answer of equations that have changed."""

import ast
import importlib.util
import shutil
from pathlib import Path

import pytest

import pteron
from pteron.kernels.kept import EQUATIONS
from pteron.workspace import home

PACKAGE = Path(pteron.__file__).parent

PLAIN = {
    *(
        "arguments",
        "atomic",
        "errors",
        "extras",
        "html_table",
        "public",
        "renamed",
        "shapes",
        "templates",
        "toml",
    ),
}
"""Modules at the top that hold messages, types and files, but no equation."""


def imported(path):
    """Return the files of the package that a file imports, by its text."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    for name in names:
        first, *parts = name.split(".")
        if first == "pteron" and parts:
            place = PACKAGE.joinpath(*parts)
            yield from (p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file())


def everything(*start):
    """Return all files that files import, directly or not; they come with them."""
    found, left = set(), list(start)
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            left += imported(path)
    return found


def key_of(package, **options):
    """Return the name under which a copy of the package would keep something."""
    spec = importlib.util.spec_from_file_location("copy", package / "kernels" / "kept.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.name_of("what", 1.0, **options)


@pytest.mark.parametrize(
    ("start", "packages"),
    [
        (PACKAGE / "kernels" / "programs.py", EQUATIONS),
        (Path(home.__file__), (*EQUATIONS, "kinematics", "workspace")),
    ],
    ids=["programs", "home poses"],
)
def test_every_file_that_it_depends_on_counts(start, packages, tmp_path):
    copy = tmp_path / "pteron"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    known, files = key_of(copy, sources=packages), 0
    for path in sorted(everything(start)):
        part = path.relative_to(PACKAGE)
        if len(part.parts) == 1 and part.stem in PLAIN:
            continue
        assert part.parts[0] in packages, f"{part} is imported, but does not count"
        text = (copy / part).read_bytes()
        (copy / part).write_bytes(text + b"\n# another line\n")
        assert key_of(copy, sources=packages) != known
        (copy / part).write_bytes(text)
        files += 1
    assert files > 50
    assert key_of(copy, sources=packages) == known
    (copy / "identification" / "__init__.py").write_text("")
    assert key_of(copy, sources=packages) == known

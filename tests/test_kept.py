"""What is kept on disk between processes is never the answer of equations that have changed."""

import ast
import importlib.util
import shutil
from pathlib import Path

import pytest
from mechanisms import NIGHTLY

import pteron
from pteron.cli.kept_machines import kept_machine
from pteron.kernels import cache
from pteron.kernels.program_cache import EQUATIONS, cached_result
from pteron.workspace import home

PACKAGE = Path(pteron.__file__).parent

PLAIN = {
    *(
        "arguments",
        "atomic",
        "errors",
        "extras",
        "html_table",
        "extensions",
        "progress",
        "public",
        "renamed",
        "result",
        "shapes",
        "templates",
        "thresholds",
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
    spec = importlib.util.spec_from_file_location("copy", package / "kernels" / "program_cache.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.name_of("what", 1.0, **options)


@pytest.mark.parametrize(
    ("start", "packages"),
    [
        (PACKAGE / "kernels" / "programs.py", EQUATIONS),
        pytest.param(
            *(Path(home.__file__), (*EQUATIONS, "dynamics", "kinematics", "workspace")),
            marks=NIGHTLY,
        ),
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
        assert part.parts[0].removesuffix(".py") in packages, (
            f"{part} is imported, but does not count"
        )
        text = (copy / part).read_bytes()
        (copy / part).write_bytes(text + b"\n# another line\n")
        assert key_of(copy, sources=packages) != known
        (copy / part).write_bytes(text)
        files += 1
    assert files > 50
    assert key_of(copy, sources=packages) == known
    (copy / "identification" / "__init__.py").write_text("")
    assert key_of(copy, sources=packages) == known


def spoilt(path, damage):
    """Damage a kept result, or replace it by another text that is whole."""
    whole = path.read_bytes()
    if damage == "cut":
        path.write_bytes(whole[:-3])
    elif damage == "changed":
        path.write_bytes(whole[:40] + bytes([whole[40] ^ 1]) + whole[41:])
    elif damage == "empty":
        path.write_bytes(b"")
    else:
        cache.store_text(path.name, damage)


@pytest.mark.parametrize(
    "damage",
    ["cut", "changed", "empty", "no pickle", "cnowhere\nAbsent\n.", "\u20ac"],
    ids=["cut", "changed", "empty", "no pickle", "unknown class", "no bytes"],
)
def test_a_damaged_result_is_found_again_and_kept(damage, tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    value, asked = (0.1, ("rho1", -2), None), []

    def result():
        return cached_result(("what", 1.0), (), lambda: asked.append(1) or value)

    assert result() == value
    assert result() == value
    assert len(asked) == 1
    (path,) = (tmp_path / cache.TEXTS).iterdir()
    spoilt(path, damage)
    assert result() == value
    assert len(asked) == 2
    assert result() == value
    assert len(asked) == 2
    assert [one.name for one in (tmp_path / cache.TEXTS).iterdir()] == [path.name]


def test_a_machine_is_that_of_its_file_as_it_is_now(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))
    file = tmp_path / "own.toml"
    pteron.save(pteron.load("delta"), file)
    for name in ("first", "second"):
        text = file.read_text(encoding="utf-8").splitlines()
        text = [f'name = "{name}"' if line.startswith("name = ") else line for line in text]
        file.write_text("\n".join(text) + "\n", encoding="utf-8")
        for _ in range(2):
            robot, unlikely = kept_machine(str(file))
            assert (robot, unlikely) == (pteron.load(file), ())
            assert robot.name == name
    assert len(list((tmp_path / "cache" / cache.TEXTS).iterdir())) == 2

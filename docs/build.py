"""Build the site, docs/_build/html: `python docs/build.py`; a warning is an error.

What is slow is made anew only where it may come out otherwise. Pictures, notebooks, the gallery and
the reference come from the code of the package, from the scripts that draw, from the extensions and
from the installed packages: a digest of all of these is kept beside the site. While it is the same,
what they made is kept, and Sphinx reads the pages alone whose text is newer. Else, or with --anew,
everything is thrown away first.
"""

from __future__ import annotations

import ast
import hashlib
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
BUILT = DOCS / "_build"
INPUTS = BUILT / "inputs.txt"

READ = (
    *("pyproject.toml", "CITATION.cff", "docs/conf.py", "docs/**/*.py", "docs/_templates/**/*"),
    *("docs/**/*.png", "docs/**/*.svg", "docs/**/*.gif", "docs/**/*.toml", "docs/*.bib"),
    *("src/**/*", "examples/**/*", "benchmarks/**/*.md", "benchmarks/**/*.svg"),
)
"""Files that the slow parts are made from; pages are Sphinx's own."""

MADE = ("_build", "gallery", "measured")
"""Folders of docs that a build fills."""


def inputs() -> Iterator[str]:
    """Yield a line for each file and installed package; of Python what it does, not says."""
    for pattern in READ:
        for path in sorted(ROOT.glob(pattern)):
            name = path.relative_to(ROOT)
            if (
                path.is_file()
                and "__pycache__" not in name.parts
                and not {*name.parts[1:2]} & {*MADE}
            ):
                yield f"{name} {hashlib.sha256(_content(path)).hexdigest()}"
    yield from sorted({f"{found.name} {found.version}" for found in distributions()})
    yield sys.version


def _content(path: Path) -> bytes:
    """Return a file; of the package's Python without comments and docstrings."""
    if path.suffix != ".py" or path.parts[: len(ROOT.parts) + 1] != (*ROOT.parts, "src"):
        return path.read_bytes()
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [one for one in body if not _says(one)]  # type: ignore[attr-defined]
    return ast.dump(tree).encode()


def _says(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def main() -> None:
    """Build; exit with the code of what fails."""
    now = "\n".join(inputs())
    if "--anew" in sys.argv or not INPUTS.is_file() or INPUTS.read_text("utf-8") != now:
        print("Code, scripts or packages are not those of the last build: all is made anew.")
        for folder in MADE:
            shutil.rmtree(DOCS / folder, ignore_errors=True)
        _run("docs/pictures/draw.py")
        now = "\n".join(inputs())
    sphinx = ["-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-d", "docs/_build/doctrees"]
    _run(*sphinx, "docs", "docs/_build/html")
    INPUTS.write_text(now, encoding="utf-8")
    _run("docs/check_site.py", "docs/_build/html")
    _run("docs/check_in_browser.py", "docs/_build/html")


def _run(*words: str) -> None:
    done = subprocess.run([sys.executable, *words], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


if __name__ == "__main__":
    main()

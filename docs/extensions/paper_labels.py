"""The paper's numbers as labels in the source: comments such as `# Eq. (12)` on lines of code.

    python docs/extensions/paper_labels.py "Eq. (12)"

prints the lines that carry a number. `docs/equations.md` has a row for each, and a test holds the
rows against the labels.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).parents[2] / "src" / "pteron"

_NUMBER = re.compile(
    r"Eqs?\. (?P<equations>\(\d+\)(?:, \(\d+\))*)"
    r"|(?:Fig\.|Lemma|Remark|Table|Contribution) \d|Section \d(?: \([a-d]\))?"
)
"""Pattern of numbers of the paper: "Eq. (1)", "Eqs. (1), (2)", "Fig. 2", "Table 1"."""

_NO_CODE = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}


class Label(NamedTuple):
    """A number of the paper on a line of code, and the function or class around it."""

    number: str
    """"Eq. (12)", "Table 1"."""
    file: str
    """Relative to the package: "legs/prrr.py"."""
    line: int
    name: str
    """Dotted, in the file: "PRRREquations.motion"; empty at the file's top level."""
    text: str
    """The line."""


def numbers_in(text: str) -> list[str]:
    """Return the paper's numbers that a text names."""
    numbers: list[str] = []
    for match in _NUMBER.finditer(text):
        if match["equations"]:
            numbers += [f"Eq. {number}" for number in match["equations"].split(", ")]
        else:
            numbers.append(match[0])
    return numbers


def labels() -> list[Label]:
    """Return every label of the package's source, in the order of files and lines."""
    return [label for path in sorted(SOURCE.rglob("*.py")) for label in _labels_of(path)]


def _labels_of(path: Path) -> Iterator[Label]:
    text = path.read_text(encoding="utf-8")
    if not _NUMBER.search(text):
        return
    lines, scopes = text.splitlines(), _scopes(ast.parse(text))
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    with_code = {row for t in tokens if t.type not in _NO_CODE for row in (t.start[0], t.end[0])}
    for token in tokens:
        row = token.start[0]
        if token.type != tokenize.COMMENT or row not in with_code:
            continue
        for number in numbers_in(token.string):
            inside = [(first, name) for name, first, last in scopes if first <= row <= last]
            name = max(inside, default=(0, ""))[1]
            file = path.relative_to(SOURCE).as_posix()
            yield Label(number, file, row, name, lines[row - 1].strip())


def _scopes(tree: ast.Module) -> list[tuple[str, int, int]]:
    """Return the dotted name of every function and class with its first and last line."""
    found: list[tuple[str, int, int]] = []

    def visit(node: ast.AST, prefix: str) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                name = f"{prefix}{child.name}"
                found.append((name, child.lineno, child.end_lineno or child.lineno))
                visit(child, f"{name}.")
            else:
                visit(child, prefix)

    visit(tree, "")
    return found


if __name__ == "__main__":
    wanted = " ".join(sys.argv[1:])
    for label in labels():
        if wanted in ("", label.number):
            print(f"{label.number}: src/pteron/{label.file}:{label.line} {label.name}")
            print(f"    {label.text}")

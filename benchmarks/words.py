"""Count what makes src/pteron hard to read: vague names, doubled classes, long functions.

vague        names of the list below bound in functions and modules (not fields of classes)
arguments    parameters of functions with such a name
bare         functions and properties that begin with a preposition, or whose name has nothing but
             participles (on -ed, -ing, -en, or listed), prepositions, pronouns and adverbs
twice        names of public classes that two modules define
long         functions of more than 60 lines, from `def` to the end without the docstring
branched     functions of McCabe complexity above 15, as ruff counts it
lines        lines of code: without docstrings, comments, imports and blank lines

`python benchmarks/words.py [--folder NAME] [--list KIND]`
"""
# ruff: noqa: SIM905

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

_SOURCES = Path(__file__).resolve().parents[1] / "src" / "pteron"
_KINDS = ("vague", "arguments", "bare", "twice", "long", "branched", "lines")
_VAGUE = """found one given own told rest kept asked made such more whole wanted held left apart
still before along across result value values data item output entry""".split()
_PREPOSITIONS = """about above across after against along among around at before behind below beside
between beyond by down during for in inside into near of off on onto out outside over past per since
through towards under until up upon within without""".split()
_EMPTY = """a an the as from to with and all another any both each it its itself less many more most
none one other others own rest same some such that them these they this those what which whole alike
apart away back bare even far here how likely not once only so still straight then there thus too
well when where why begun bent bought brought built caught come cut done felt found gone heard held
hung kept known laid led left lent let lost made meant met paid said sent shown sold spent split
spread stood taught thought told understood won worn wound""".split()
_NOUNS = """bearing embed feed grouping heading need open reading ring screen seed setting spacing
speed spring string token""".split()
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def _is_bare(name: str) -> bool:
    words = name.strip("_").split("_")
    participles = {word for word in words if re.fullmatch("..+(ed|ing|en)", word)} - {*_NOUNS}
    return words[0] in _PREPOSITIONS or {*words} <= {*_PREPOSITIONS, *_EMPTY, *participles}


def _lines(node: ast.AST) -> set[int]:
    return set(range(node.lineno, node.end_lineno + 1))  # type: ignore[attr-defined]


def _findings(path: Path) -> Iterator[tuple[str, int, str]]:
    """Yield kind, line and name of what a file holds, except functions with many branches."""
    text = path.read_text()
    nodes = list(ast.walk(ast.parse(text)))
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    statements = [s for node in classes for s in node.body if not isinstance(s, _Function)]
    fields = {target for statement in statements for target in ast.walk(statement)}
    code = {n for n, line in enumerate(text.splitlines(), 1) if line.strip()[:1] not in ("", "#")}
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            code -= _lines(node)
        if isinstance(node, ast.Module | ast.ClassDef | _Function) and ast.get_docstring(node):
            code -= _lines(node.body[0])
        if isinstance(node, ast.arg) and node.arg in _VAGUE:
            yield "arguments", node.lineno, node.arg
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield "twice", node.lineno, node.name
        if isinstance(node, _Function):
            if _is_bare(node.name):
                yield "bare", node.lineno, node.name
            docstring = _lines(node.body[0]) if ast.get_docstring(node) else set()
            if (length := len(_lines(node) - docstring)) > 60:
                yield "long", node.lineno, f"{node.name} {length}"
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node not in fields:
            yield "vague" if node.id in _VAGUE else "bound", node.lineno, node.id
    for number in code:
        yield "lines", number, ""


def main() -> None:
    """Print the table of counts, or every place of one kind."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--list", choices=_KINDS)
    parser.add_argument("--folder", help="of src/pteron")
    options, _ = parser.parse_known_args()
    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--select", "C901"]
    command += ["--output-format", "json", "--config", "lint.mccabe.max-complexity=15"]
    report = subprocess.run([*command, str(_SOURCES)], capture_output=True, check=False).stdout
    places = [
        ("branched", Path(fault["filename"]), fault["location"]["row"], fault["message"])
        for fault in json.loads(report)
    ]
    for path in sorted(_SOURCES.rglob("*.py")):
        places += [(kind, path, line, name) for kind, line, name in _findings(path)]
    modules = Counter(name for name, _ in {(p[3], p[1]) for p in places if p[0] == "twice"})
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    names: Counter[str] = Counter()
    for kind, path, line, name in places:
        folder = path.relative_to(_SOURCES).parts[0].removesuffix(path.name) or "."
        if options.folder in (None, folder) and (kind != "twice" or modules[name] > 1):
            counts[folder][kind] += 1
            names[name] += kind == "vague"
            if kind == options.list:
                print(f"{path.relative_to(_SOURCES)}:{line}: {name}")
    counts["all"] = sum(counts.values(), Counter())
    print(f"{'folder':<16}" + "".join(f"{kind:>11}" for kind in _KINDS))
    for folder, row in sorted(counts.items(), key=lambda row: (row[0] == "all", row[0])):
        print(f"{folder:<16}" + "".join(f"{row[kind]:>11}" for kind in _KINDS))
    print(", ".join(f"{name} {number}" for name, number in names.most_common() if number))


if __name__ == "__main__":
    main()

"""Write the table of README.md beside this file: the claims of which some cases wait, and where.

`python tests/waiting.py` after a mark `nightly` or `clients` was set, moved or taken away.
"""

from collections import Counter, defaultdict
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

README = Path(__file__).parent / "README.md"
BEGIN, END = "<!-- the table of waiting.py -->\n", "<!-- its end -->\n"


class Counts:
    """Counts the cases of each test, by where they run."""

    def __init__(self):
        self.found = defaultdict(Counter)

    def pytest_collection_finish(self, session):
        for item in session.items:
            file, _, rest = item.nodeid.partition("::")
            places = [mark for mark in ("nightly", "clients") if item.get_closest_marker(mark)]
            self.found[file, rest.partition("[")[0]][places[0] if places else "test"] += 1


def table():
    """Return the table, one line a test of which not all cases are in the gate."""
    counts = Counts()
    options = ["--collect-only", "-qq", "-m", "", "-p", "no:cacheprovider", str(README.parent)]
    with redirect_stdout(StringIO()) as told:
        ended = pytest.main(options, plugins=[counts])
    if ended != pytest.ExitCode.OK:
        raise SystemExit(told.getvalue())
    lines = [
        "| Claim | File | `make test` | `make clients` | `make nightly` |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    for (file, name), found in sorted(counts.found.items()):
        if found["test"] < found.total():
            claim = name.removeprefix("test_").replace("_", " ")
            cases = found["test"], found["clients"], found.total()
            shown = " | ".join(str(n or "") for n in cases)
            lines.append(f"| {claim} | {Path(file).name} | {shown} |")
    return "\n".join(lines) + "\n"


def parts():
    """Return README's text before the table, the table that it has, and the text behind it."""
    before, _, rest = README.read_text(encoding="utf-8").partition(BEGIN)
    old, _, after = rest.partition(END)
    return before, old, after


if __name__ == "__main__":
    before, _, after = parts()
    README.write_text(before + BEGIN + table() + END + after, encoding="utf-8")

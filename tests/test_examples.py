"""Every example runs as it stands, and prints something."""

import runpy
from pathlib import Path
from unittest.mock import patch

import pytest

from pteron.legs import KINDS

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.name)
def test_it_runs(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(script)])
    with patch.dict(KINDS):  # a kind of leg that an example adds is gone after it
        runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.strip()
    # What README shows of it, up to its "...", is what it prints.
    readme = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    _, command, shown = readme.partition(f"$ .venv/bin/python examples/{script.name}\n")
    if command:
        lines = shown.split("    ...\n")[0].splitlines()
        assert printed.splitlines()[: len(lines)] == [line.removeprefix("    ") for line in lines]

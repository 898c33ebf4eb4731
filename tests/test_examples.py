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
    assert capsys.readouterr().out.strip()

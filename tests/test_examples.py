"""Every example runs as it stands, and prints something."""

import ast
import runpy
from pathlib import Path
from unittest.mock import patch

import pytest
from mechanisms import CLIENTS, gated

import pteron
from pteron.legs import KINDS

FOLDER = Path(__file__).parent.parent / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
GALLERY = sorted((FOLDER / "gallery").rglob("plot_*.py"))


SLOW = {"base_parameters.py", "identify.py", "platform_size.py"}


@pytest.mark.parametrize(
    "script",
    gated(EXAMPLES, [path for path in EXAMPLES if path.name not in SLOW], CLIENTS),
    ids=lambda path: path.name,
)
def test_it_runs(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(script)])
    with patch.dict(KINDS):  # a kind of leg that an example adds is gone after it
        runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.strip()


@pytest.mark.parametrize("script", GALLERY, ids=lambda path: path.name)
def test_a_page_of_the_gallery_is_short_and_shows_a_picture(script):
    """That each runs is what making the pages shows."""
    text = script.read_text()
    module = ast.parse(text)
    title, line, *sentences = ast.get_docstring(module).splitlines()
    assert script.name.startswith("plot_")
    assert set(line) == {"="}
    assert len(line) == len(title)
    assert "".join(sentences).strip().endswith((".", "?"))
    assert len(text.splitlines()) <= 45
    calls = [node.func for node in ast.walk(module) if isinstance(node, ast.Call)]
    asked = {ast.unparse(call).removeprefix("pteron.plots.") for call in calls}
    assert asked & set(pteron.plots.__all__)
    if "film" not in asked:
        # The gallery shows what a name of the script keeps.
        kept = [node.value for node in module.body if isinstance(node, ast.Assign)]
        assert any(ast.unparse(value).startswith("pteron.plots.") for value in kept)

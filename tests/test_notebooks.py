"""The notebooks' form, and how pictures show in one; the documentation's build executes them."""

import re
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import IPython.display
import nbformat
import numpy as np
import pytest
from matplotlib.image import imread
from mechanisms import CLIENTS

from pteron.plots import forces_figure

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return nbformat.read(request.param, as_version=nbformat.NO_CONVERT)


def test_each_is_in_the_list_in_this_order():
    listed = re.findall(r"^(\d-[\w-]+)$", (FOLDER / "index.md").read_text("utf-8"), re.MULTILINE)
    assert listed == [path.stem for path in NOTEBOOKS]
    assert [name[0] for name in listed] == list("123456789")


def test_it_is_valid_and_names_no_kernel_but_the_usual_one(notebook):
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert notebook.metadata.kernelspec.name == "python3"
    ids = [cell.id for cell in notebook.cells]
    assert len(set(ids)) == len(ids)


def test_it_is_kept_without_outputs(notebook):
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


def test_it_begins_with_its_title_checks_itself_and_leaves_something_to_try(notebook):
    prose = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert notebook.cells[0].cell_type == "markdown"
    assert notebook.cells[0].source.startswith("# ")
    assert sum(line.startswith("# ") for text in prose for line in text.splitlines()) == 1
    assert any("\nassert " in f"\n{source}" for source in code)
    assert "## Try it" in prose[-1]


def test_its_links_lead_somewhere(notebook):
    prose = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    targets = re.findall(r"\]\(([^)]+)\)", "\n".join(prose))
    assert targets
    for target in targets:
        if not target.startswith("https://"):
            assert (FOLDER / unquote(target.partition("#")[0])).is_file(), target


@CLIENTS
def test_another_machine_too_is_identified_with_its_calibrated_geometry_only():
    page = nbformat.read(FOLDER / "8-calibrate-then-identify.ipynb", as_version=nbformat.NO_CONVERT)
    code = "\n".join(cell.source for cell in page.cells if cell.cell_type == "code")
    assert code.count("default_rng(3)") == 1
    # It checks itself. In other machines, as of seed 6, the drawing costs less than 1 % of the
    # forces of a cycle, and is not named.
    exec(code.replace("default_rng(3)", "default_rng(8)"), {"display": str})


def test_a_notebook_shows_a_picture_on_white_without_pyplot(monkeypatch):
    shown = []
    monkeypatch.setattr(
        IPython.display, "display", lambda data, metadata, raw: shown.append((data, metadata))
    )
    time = np.linspace(0.0, 1.0, 11)
    figure = forces_figure(time, np.sin(time)[:, None])
    figure._ipython_display_()
    ((data, metadata),) = shown
    picture = imread(BytesIO(data["image/png"]))
    assert (picture[0, 0] == 1.0).all()  # white, and opaque
    assert picture[..., 3].min() == 1.0
    width, height = figure.get_size_inches()
    assert metadata["image/png"] == {"width": round(96 * width), "height": round(96 * height)}


def test_a_saved_picture_has_the_ground_that_was_asked_for():
    figure = forces_figure(np.array([0.0, 1.0]), np.array([[1.0], [2.0]]))
    for look, alpha in (({}, 1.0), ({"transparent": True}, 0.0)):
        file = BytesIO()
        figure.savefig(file, format="png", **look)
        file.seek(0)
        assert imread(file)[0, 0, 3] == alpha

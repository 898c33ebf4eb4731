"""The wheel holds all that the package needs, and is bound to no machine.

That it works where it is installed, `make wheels` tries: see tests/installed/matrix.py.
"""

import re
import runpy
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> ZipFile:
    """The wheel of this clone, built without network by the backend that is installed."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    code = f"from hatchling.build import build_wheel; build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True)
    (found,) = folder.glob("*.whl")
    assert found.name.endswith("-py3-none-any.whl")
    return ZipFile(found)


def test_every_file_of_the_package_is_in_the_wheel_and_nothing_else(wheel: ZipFile):
    source = ROOT / "src"
    files = [path for path in source.rglob("*") if path.is_file()]
    expected = {
        path.relative_to(source).as_posix() for path in files if "__pycache__" not in path.parts
    }
    packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert packed == expected
    kinds = {name.rpartition(".")[2] for name in packed}
    assert kinds <= {"py", "typed", "toml", "j2", "css", "js", "svg", "json", "npz", "pyi", "csv"}


def test_the_wheel_names_every_extra_and_the_command(wheel: ZipFile):
    (metadata,) = (name for name in wheel.namelist() if name.endswith("/METADATA"))
    text = wheel.read(metadata).decode()
    for extra in ("consistency", "gymnasium", "jax", "motion", "numba", "viewer", "all"):
        assert f"Provides-Extra: {extra}\n" in text
    (entry,) = (name for name in wheel.namelist() if name.endswith("/entry_points.txt"))
    assert "pteron = pteron_command:main" in wheel.read(entry).decode()


def test_a_registry_shows_the_pictures_of_readme(wheel: ZipFile):
    """Where the repository is known; in the wheel of this clone README is as it stands."""
    (metadata,) = (name for name in wheel.namelist() if name.endswith("/METADATA"))
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert wheel.read(metadata).decode().replace("\r\n", "\n").endswith(text)
    made = runpy.run_path(str(ROOT / "hatch_build.py"))["with_addresses"]
    led = made(text, "https://h/p/", "1.0")
    assert "](https://h/p/raw/v1.0/docs/delta.gif)" in led
    assert "](https://h/p/blob/v1.0/docs/evidence.md#is-it-right)" in led
    assert not re.search(r"\]\((?!https://)", led)


def test_text_is_read_and_written_in_utf_8_whatever_the_machine_speaks():
    """On Windows the default is another one; ruff finds what does not say its own."""
    ruff = [sys.executable, "-m", "ruff", "check", "--isolated", "--preview"]
    run = subprocess.run(
        [*ruff, "--select", "PLW1514", str(ROOT / "src")],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert run.returncode == 0, run.stdout

"""Programs of users, as type checkers in strict mode and the interpreter see them."""

import subprocess
import sys
from pathlib import Path

import pytest
from mechanisms import CLIENTS, gated

FOLDER = Path(__file__).parent / "typed"
PROGRAMS = sorted(path.stem for path in FOLDER.glob("*.py"))


@CLIENTS
def test_programs_pass_mypy_in_strict_mode(tmp_path):
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file",
        "",
        "--cache-dir",
        tmp_path,
    ]
    checked = subprocess.run([*command, FOLDER], capture_output=True, text=True, check=False)
    assert checked.stdout.startswith("Success"), checked.stdout + checked.stderr
    assert f"in {len(PROGRAMS)} source files" in checked.stdout
    for path in FOLDER.glob("*.py"):
        assert 9 < len(path.read_text(encoding="utf-8").splitlines()) < 41, path.name


@pytest.mark.parametrize("name", gated(PROGRAMS, ["machines", "kinematics"], CLIENTS))
def test_a_program_runs(name):
    command = [sys.executable, "-W", "error", FOLDER / f"{name}.py"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    words = ended.stdout.split()
    assert words
    assert "False" not in words or name == "machines"

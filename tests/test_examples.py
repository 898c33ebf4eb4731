"""Every example runs as it stands, every benchmark in its short form, and prints something."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
BENCHMARKS = sorted((ROOT / "benchmarks").glob("[!_]*.py"))


@pytest.mark.parametrize("script", [*EXAMPLES, *BENCHMARKS], ids=lambda path: path.name)
def test_it_runs(script, tmp_path):
    options = ["--quick"] if script in BENCHMARKS else []
    done = subprocess.run(
        [sys.executable, "-W", "error", script, *options],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()

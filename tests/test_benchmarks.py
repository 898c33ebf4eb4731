"""Every benchmark runs in its short form, and prints something; the gate tries the quickest."""

import subprocess
import sys
from pathlib import Path

import pytest
from mechanisms import CLIENTS, gated

BENCHMARKS = sorted((Path(__file__).parent.parent / "benchmarks").glob("[!_]*.py"))


@pytest.mark.parametrize(
    "script",
    gated(BENCHMARKS, [path for path in BENCHMARKS if path.name == "operations.py"], CLIENTS),
    ids=lambda path: path.name,
)
def test_it_runs(script, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", script, "--quick"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()

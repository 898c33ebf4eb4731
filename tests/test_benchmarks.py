"""Every benchmark runs in its short form, and prints something; the gate tries the quickest."""

import re
import runpy
import subprocess
import sys
from dataclasses import replace
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


def test_what_make_evidence_compares_is_stated_on_its_page(monkeypatch):
    made = runpy.run_path(str(BENCHMARKS[0].parent / "evidence.py"))
    claims = made["claims"]()
    assert len({claim.says for claim in claims}) == len(claims) > 15
    for claim in claims:
        assert len(claim.values) == max(re.compile(claim.found).groups, 1), claim.says
        words = [word for word in claim.command.split() if "/" in word or word in ("-c", "-m")]
        assert words[0][0] == "-" or (BENCHMARKS[0].parents[1] / words[0]).is_file(), claim.says
    (speed,) = (claim for claim in claims if claim.says == "operations, factored")
    for output, word in (("409 329", "same"), ("409 330", "differs"), ("", "differs")):
        verdict = made["verdict"]
        monkeypatch.setitem(verdict.__globals__, "ran", lambda _: (0, output))  # noqa: B023
        assert verdict(replace(speed, found=r"(\d+) (\d+)"))[2] == word

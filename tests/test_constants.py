"""Constants a third and three times as large: those that change a result state their reason."""

import ast
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from mechanisms import NIGHTLY

ROOT = Path(__file__).parents[1]

DECIDING = {
    "pteron.calibration.raw_faults._FINALISTS",
    # The standard cycle: its way, and how it is passed.
    "pteron.motion.trajectories.cycle.LIFT",
    "pteron.motion.trajectories.cycle.ACROSS",
    "pteron.motion.trajectories.cycle._LIFT_ENDS",
    "pteron.motion.trajectories.cycle._ACROSS_BEGINS",
}
"""Constants that change a result of `benchmarks/constants.py`; each says why it has its value."""


def documented(name):
    """Return the text behind a constant."""
    module, _, constant = name.rpartition(".")
    path = Path(*("src", *module.split("."))).with_suffix(".py")
    body = ast.parse((ROOT / path).read_text()).body
    for node, after in pairwise(body):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == constant:
            assert isinstance(after, ast.Expr), name
            return ast.literal_eval(after.value)
    raise AssertionError(f"{name}: no such constant")


@pytest.mark.parametrize("name", sorted(DECIDING))
def test_a_constant_that_decides_says_why_it_has_its_value(name):
    assert len(documented(name).split()) >= 8


def changed(*arguments):
    """Return the constants that change a result, and how, in a process of its own: it forks."""
    command = [sys.executable, ROOT / "benchmarks" / "constants.py", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(re.findall(r"^  (pteron\S+) = (.*)$", done.stdout, re.MULTILINE))


def test_a_scaled_constant_is_seen_where_it_is_used():
    assert set(changed("motion", "--names", "cycle.LIFT")) == {
        "pteron.motion.trajectories.cycle.LIFT"
    }


@NIGHTLY
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("folder", ["calibration", "workspace", "kinematics", "motion"])
def test_other_constants_change_no_result(folder):
    """Those of identification take hours: `python benchmarks/constants.py identification`."""
    found = changed(folder, "--jobs", "2")
    assert {name: line for name, line in found.items() if name not in DECIDING} == {}

"""Constants a third and three times as large: those that change a result state their reason."""

import ast
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from mechanisms import NIGHTLY

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import constants

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
    body = ast.parse((Path(__file__).parents[1] / path).read_text()).body
    for node, after in pairwise(body):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == constant:
            assert isinstance(after, ast.Expr), name
            return ast.literal_eval(after.value)
    raise AssertionError(f"{name}: no such constant")


@pytest.mark.parametrize("name", sorted(DECIDING))
def test_a_constant_that_decides_says_why_it_has_its_value(name):
    assert len(documented(name).split()) >= 8


def test_a_scaled_constant_is_seen_where_it_is_used():
    (lift,) = (c for c in constants.constants("motion") if c.name == "LIFT")
    usual = constants.results(constants.motions, None, 1.0)
    assert constants.results(constants.motions, lift, 3.0) != usual
    assert constants.results(constants.motions, None, 1.0) == usual


@NIGHTLY
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("folder", [f for f in constants.TASKS if f != "identification"])
def test_other_constants_change_no_result(folder):
    """Those of identification take hours: `python benchmarks/constants.py identification`."""
    found = {f"{c.module}.{c.name}": line for c, _, line in constants.deciding(folder, jobs=2)}
    assert {name: line for name, line in found.items() if name not in DECIDING} == {}

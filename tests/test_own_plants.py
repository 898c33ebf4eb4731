"""Plants whose equations are not Pteron's: faults are named, and no fault where there is none."""

import sys
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS, several

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks" / "identification"))

import own_plants
from own_plants import FAULTS, PLANTS, faultless, moved, row_of

from pteron.identification import Log, identify

GATE = [("linear-delta", "lost samples"), ("five-bar", "gravity turned"), ("five-bar", "jitter")]
EVERY = [(name, fault) for name in ("linear-delta", "five-bar") for fault in FAULTS]


@pytest.mark.parametrize("name", ["five-bar", "linear-delta"])
def test_its_forces_are_those_of_the_model(name):
    """Two derivations, by d'Alembert over point masses and by Pteron's legs, agree."""
    plant = PLANTS[name]()
    symbols = tuple(leg.joint for leg in plant.drawn.legs)
    log, other = (
        Log(f"{k}", m.time, m.joints, m.forces, symbols=symbols)
        for k, m in ((k, moved(plant, k)) for k in (1, 2))
    )
    result = identify(plant.drawn, log, held_out=other)
    assert result.held_out[0].nrms.max() < 1e-6
    assert result.causes == ()


@pytest.mark.parametrize(("name", "fault"), several(EVERY, GATE, CLIENTS))
def test_a_fault_is_among_the_first_two_causes_and_misleads_nobody(name, fault):
    row = row_of(name, fault, 1)
    assert row.right, row
    assert not row.misleads, row
    assert row.worse == (), row


@CLIENTS
def test_intervals_hold_and_nothing_is_accused_without_a_fault():
    seen = faultless(PLANTS["linear-delta"](), 20)
    assert seen.accused == ()
    # 320 intervals at 95 %, three standard errors of their share.
    least = 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / seen.intervals)
    assert seen.within / seen.intervals > least


def test_every_fault_changes_a_log_or_a_file():
    plant = PLANTS["linear-delta"]()
    for fault in FAULTS:
        case = own_plants.case_of(plant, fault, 1)
        before = case.time, case.joints, case.forces, case.drawn
        own_plants.recorded(case, fault, "log")
        after = case.time, case.joints, case.forces, case.drawn
        assert any(a is not b for a, b in zip(before, after, strict=True))

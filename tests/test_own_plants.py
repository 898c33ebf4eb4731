"""Plants whose equations are not Pteron's: faults are named, and no fault where there is none."""

import sys
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS, several

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks" / "identification"))

import own_plants
from own_plants import FAULTS, PLANTS, faultless, moved, row_of

import pteron
from pteron.identification import Log, States, identify

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


@CLIENTS
def test_the_file_of_bodies_that_are_not_quite_real_predicts_as_well_as_the_values():
    """Friction and offsets of a fit went with base parameters of no real bodies: 3.2 % for 0.3."""
    plant = PLANTS["ball-table"]()
    pair = [own_plants.case_of(plant, "none", 2 + k) for k in (0, 1000)]
    log, other = (own_plants.recorded(case, "none", f"{k}") for k, case in enumerate(pair))
    result = identify(plant.drawn, log, held_out=other)
    assert not result.consistency.feasible
    third = own_plants.case_of(plant, "none", 2002).motion
    about = third.joints, third.rates, third.accelerations
    start = result.preprocessing[0].start
    states = States.of_joints(plant.drawn, about, third.time, start)
    by_values = result.model.matrix(states) @ result.estimate.values
    by_file = pteron.drive_forces(result.machine, states.pose, states.velocity, states.acceleration)
    errors = [
        np.sqrt(((forces - third.forces) ** 2).mean(axis=0)) for forces in (by_values, by_file)
    ]
    assert (errors[1] < 1.3 * errors[0] + 1e-3 * third.forces.std(axis=0)).all(), errors


def test_every_fault_changes_a_log_or_a_file():
    plant = PLANTS["linear-delta"]()
    for fault in FAULTS:
        case = own_plants.case_of(plant, fault, 1)
        before = case.time, case.joints, case.forces, case.drawn
        own_plants.recorded(case, fault, "log")
        after = case.time, case.joints, case.forces, case.drawn
        assert any(a is not b for a, b in zip(before, after, strict=True))

"""Plants whose equations are not Pteron's: faults are named, and no fault where there is none."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS, several

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks" / "identification"))

import own_plants
from own_plants import (
    FAULTS,
    HIDDEN,
    PLANTS,
    Answer,
    Conditions,
    answered,
    faultless,
    moved,
    row_of,
)

import pteron
from pteron.identification import Log, Processing, States, identify
from pteron.identification.faults.assumptions import hidden_orders
from pteron.identification.signals import preprocessing_for_log

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


def answer(name: str, fault: str, seed: int, /, *, other: bool = False, **conditions) -> Answer:
    """Return what is said of a plant, or one of other dimensions, under other conditions."""
    plant = PLANTS[name](other=True) if other else PLANTS[name]()
    return answered(replace(plant, conditions=Conditions(**conditions)), fault, seed)


SMALL = {"other": True, "period": 6.0, "motion": 0.7}
"""A small slow motion of a machine of other dimensions."""


def test_a_payload_that_nobody_declared_is_named_with_its_mass():
    """30 % of 30 g, in the second half; drifting friction was named, or nothing."""
    cause = answer("five-bar", "payload", 101).causes[0]
    mass = float(re.match(r"The platform carries about ([\d.]+) kg more in", cause)[1])
    assert mass == pytest.approx(0.009, rel=0.1)


def test_a_zero_that_a_small_motion_hides_is_said_first():
    """A zero 1.4 degrees off: values take it in, and another motion is 14 % off."""
    hidden = answer("five-bar", "zero off", 113, **SMALL)
    assert hidden.off > 10.0
    assert hidden.first.startswith(HIDDEN)
    assert "a joint's zero" in hidden.first
    assert "a joint's zero" not in answer("five-bar", "none", 101).first


def test_the_expected_error_is_that_of_other_motions_too():
    """A zero that is off spared the reference cycle: 5 % was expected of 25 %."""
    conditions = {"noise": 0.003, "rate": 1000.0, "begin": 1e9, "fault": 0.5}
    seen = answer("five-bar", "zero off", 111, **conditions)
    assert seen.off > 20.0
    assert seen.expected > 0.8 * seen.off


def test_lengths_that_every_machine_has_off_are_no_fault():
    """Two mm off a singularity smoothed positions looked like a length 0.03 mm off."""
    plant = replace(PLANTS["five-bar"](), home=np.array([0.0, 0.106]))
    seen = answered(replace(plant, conditions=Conditions(motion=0.95)), "none", 131)
    assert seen.grade == "trustworthy"
    assert seen.causes == ()


def test_little_jitter_comes_before_drives_that_give():
    """Where 5 % of a step makes drives seem to give, and the forces 8 % wrong."""
    conditions = {"noise": 0.003, "rate": 200.0, "period": 2.5, "fault": 1.225}
    seen = answer("linear-delta", "jitter", 141, **conditions)
    assert seen.grade != "trustworthy"
    assert "jitter" in seen.causes[0]


@CLIENTS
def test_a_working_mode_is_no_gear_ratio():
    """Half the way and free parameters left 1.2 % of the forces, the right mode 0.97 %."""
    assert "working mode" in answer("ball-table", "wrong elbow", 113, **SMALL).causes[0]


@CLIENTS
def test_a_refused_log_names_the_payload():
    seen = answer("ball-table", "payload", 113, **SMALL)
    assert seen.grade == "refused"
    assert "as an undeclared payload" in seen.first


def test_orders_of_a_hexapods_legs_that_symmetry_hides_are_said():
    plant = PLANTS["hexapod"]()
    log = own_plants.recorded(own_plants.case_of(plant, "none", 121), "none", "log")
    said = hidden_orders(plant.drawn, log, preprocessing_for_log(plant.drawn, log, Processing()))
    assert said.startswith(HIDDEN)
    assert "2-1-6-5-4-3" in said


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
    states = States.from_joints(plant.drawn, about, third.time, start)
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

"""The file that an identification writes: its drives' forces are those of the machine."""

import json
from dataclasses import replace

import numpy as np
import pytest
from logs_of_motions import machine, motion
from mechanisms import CLIENTS, several

import pteron
from pteron.export.identified_parameters import read_identified
from pteron.identification import Log, identify
from pteron.identification.signals.states import FullMotion
from pteron.json_values import json_ready
from pteron.legs import Drive
from pteron.manipulator import parameter_data
from pteron.reduction import base_regressor

GATE = [("tripteron", False), ("linear-delta", True), ("delta", True), ("five-bar", False)]
EVERY = [(name, shared) for name in pteron.catalog() for shared in (False, True)]


def with_rotors(robot):
    """Return a machine with another rotor and gear in each drive, and gravity from all sides."""
    drives = [
        Drive(rotor_inertia=2e-5 * (1.0 + 0.3 * k), ratio=60.0 + 10.0 * k)
        for k in range(len(robot.legs))
    ]
    legs = zip(robot.legs, drives, strict=True)
    return replace(
        robot,
        legs=tuple(replace(leg, drive=drive) for leg, drive in legs),
        gravity=(3.0, -5.0, -7.0),
    )


def as_built(robot, *, alike):
    """Return a machine with other masses and friction, its legs `alike` or not."""
    values, places = pteron.parameters(robot), {}
    for k, parameter in enumerate(parameter_data(robot)):
        places.setdefault((parameter.kind, parameter.body, alike or parameter.legs), []).append(k)
    rng = np.random.default_rng(1)
    factors = {(body, legs): rng.uniform(0.8, 1.2) for _, body, legs in places}
    for (_, body, legs), same in places.items():
        values[same] = values[same].mean() * factors[body, legs]
    robot = pteron.with_parameters(robot, values)
    drives = [
        replace(leg.drive, coulomb=0.5 + 0.1 * k, viscous=0.3, offset=0.2 - 0.1 * k)
        for k, leg in enumerate(robot.legs)
    ]
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))


def moved(robot, built, seed, rows=1500):
    """Return the log, without noise, of a motion, and the motion's states."""
    size = 0.05 * float(np.mean([leg.size for leg in robot.legs if leg.size] or [1.0]))
    time = np.arange(rows) / 500.0
    low, high = np.array([leg.limits or (-np.inf, np.inf) for leg in robot.legs]).T
    for share in (1.0, 0.5, 0.2, 0.1, 0.05, 0.02):
        # Strokes are long or short: the Rubin hexapods' is 3 % of their rams.
        shape = {"period": 3.0, "harmonics": 5, "size": share * size, "turn": 0.15 * share}
        states = motion(robot, time, seed=seed, **shape)
        joints = FullMotion.from_platform(robot, *states).joints
        if ((joints > low) & (joints < high)).all():
            break
    forces = pteron.drive_forces(built, *states)
    symbols = tuple(leg.joint for leg in robot.legs)
    return Log(f"motion {seed}", time, joints, forces, symbols=symbols), states


@pytest.mark.parametrize(("name", "shared"), several(EVERY, GATE, CLIENTS))
def test_the_written_file_reproduces_forces_that_were_held_out(name, shared, tmp_path):
    robot = with_rotors(machine(name))
    try:
        base = pteron.base_parameters(robot, shared=shared)
    except pteron.errors.ModelError as error:
        pytest.skip(str(error))
    built = as_built(robot, alike=shared)
    (log, _), (other, states) = (moved(robot, built, seed) for seed in (1, 2))
    result = identify(robot, log, held_out=other, shared=shared)
    assert result.model.base.rank == base.rank
    path = tmp_path / "identified.toml"
    pteron.save(result.machine, path)
    forces = pteron.drive_forces(pteron.load(path), *states)
    off = np.abs(forces - other.forces).max(axis=0)
    assert (off < 1e-6 * np.abs(other.forces).max(axis=0)).all(), off
    # Code from base parameters takes another road: what rotors add is in both, values and offsets.
    file = tmp_path / "identification.json"
    file.write_text(json.dumps(json_ready(result.as_dict())))
    of_base = read_identified(robot, file)
    rigid = base_regressor(of_base.robot, of_base.base, *states) @ of_base.values
    q = FullMotion.from_platform(robot, *states)
    for k, leg in enumerate(of_base.robot.legs):
        drive = leg.drive
        rigid[:, k] += drive.inertia * q.accelerations[:, k] + drive.viscous * q.rates[:, k]
        rigid[:, k] += drive.coulomb * np.sign(q.rates[:, k]) + drive.offset
    off = rigid - other.forces
    if robot.redundancy:  # a rotor's force is its joint's, a base parameter's is shared: both move
        off = (off[:, None] @ pteron.jacobian(robot, states[0]))[:, 0]
    assert (np.abs(off).max(axis=0) < 1e-6 * np.abs(other.forces).max()).all(), off
    assert result.verdict.grade == "trustworthy" or not result.consistency.feasible


@pytest.mark.parametrize("ratios", [(30.0, 30.0, 30.0), (30.0, 40.0, 50.0)])
def test_shared_legs_with_rotors_are_not_accused_of_a_gain(ratios):
    """Rotors join what the legs share but for their differences, which may be zero."""
    robot = machine("delta")
    legs = zip(robot.legs, ratios, strict=True)
    drawn = replace(
        robot,
        legs=tuple(
            replace(leg, drive=Drive(rotor_inertia=2e-5, ratio=ratio)) for leg, ratio in legs
        ),
    )
    built = as_built(drawn, alike=True)
    rng = np.random.default_rng(0)

    def noisy(log):
        forces = log.forces + 0.01 * log.forces.std(axis=0) * rng.normal(size=log.forces.shape)
        return replace(log, forces=forces)

    logs = [noisy(moved(drawn, built, seed)[0]) for seed in (1, 2)]
    result = identify(drawn, logs[0], held_out=logs[1], shared=True)
    assert result.verdict.grade == "trustworthy"
    assert result.causes == ()
    assert (result.reflected_inertia > 0.0).all()

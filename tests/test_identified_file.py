"""The file that an identification writes: its drives' forces are those of the machine."""

from dataclasses import replace

import numpy as np
import pytest
from logs_of_motions import machine, motion
from mechanisms import CLIENTS, several

import pteron
from pteron.identification import Log, identify
from pteron.identification.faults import FaultIsolation
from pteron.identification.signals.states import FullMotion
from pteron.legs import Drive
from pteron.manipulator import parameter_data

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
    shape = {"seed": seed, "period": 3.0, "harmonics": 5, "size": size, "turn": 0.15}
    states = motion(robot, time, **shape)
    joints = FullMotion.of_platform(robot, *states).joints
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
    assert isinstance(result.fault_isolation, FaultIsolation)
    if not result.consistency.feasible:
        pytest.fail(str(result.consistency.distance))

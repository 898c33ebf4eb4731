"""Faults of a log or a machine that identification tells by name: none is seen where none is."""

from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import RATE, brisk, clean, found, late_by, noisy
from logs_of_motions import log_of, machine
from mechanisms import CLIENTS, NIGHTLY, gated, random_machine
from scipy.interpolate import make_interp_spline

import pteron
from pteron.identification import Processing, Terms, identification_model, identify
from pteron.identification.faults import isolate_faults
from pteron.identification.faults.columns import FaultColumns, families_of
from pteron.identification.faults.fitted_motion import FittedMotion, lengths_of
from pteron.identification.recordings import read_recording
from pteron.identification.signals import States
from pteron.legs import Drive, Stribeck
from pteron.workspace import home_pose


def named(robot, log, **how):
    """Return the first fault that is named, and all that is said."""
    result = found(robot, log, **how)
    assert result.verdict.grade != "trustworthy"
    first = result.fault_isolation.faults[0]
    assert first.message in result.verdict.reasons
    return first, result


@pytest.mark.parametrize(
    "name",
    gated(["quadrupteron", "delta", "par4", "five-bar", "mixed"], ["five-bar", "mixed"]),
)
def test_no_fault_is_named_where_there_is_none(name):
    robot, log, _ = clean(name)
    result = found(robot, noisy(log))
    assert result.fault_isolation.faults == ()
    assert (result.fault_isolation.spoiled == 0.0).all()


@pytest.mark.parametrize(
    ("name", "delay"),
    [("delta", 3e-3), pytest.param("quadrupteron", 8e-3, marks=NIGHTLY)],
)
def test_a_delay_is_measured_and_taken_out(name, delay):
    robot, log, _ = clean(name)
    late = noisy(replace(log, forces=late_by(log, delay)))
    first, _ = named(robot, late, processing=Processing(delay=0.0))
    assert first.fault == "delay"
    assert first.sizes[0] == pytest.approx(delay, abs=5.0 * first.deviations[0])
    assert f"{1e3 * first.sizes[0]:.3g} ms" in first.message
    # By default it is found and taken out, and said.
    mended = found(robot, late)
    assert "late for the positions; this is corrected" in mended.causes[0]
    assert not any(one.fault == "delay" for one in mended.fault_isolation.faults)
    assert mended.preprocessing[0].delay == pytest.approx(delay, abs=3e-4)


@pytest.mark.parametrize("derivatives", ["central", "spline", "periodic"])
def test_a_delay_that_is_given_is_exact(derivatives):
    robot, log, _ = clean("delta")
    steps = 3
    late = replace(
        log, time=log.time[:-steps], joints=log.joints[steps:], forces=log.forces[:-steps]
    )
    how = Processing(derivatives=derivatives, period=2.0, delay=steps / RATE)
    base = identification_model(robot).base
    values = found(robot, late, processing=how).base_values
    assert np.abs(values - base.values(robot)).max() < 1e-7 * np.abs(values).max()


@CLIENTS
def test_a_force_out_of_scale_is_named():
    robot, log, _ = clean("par4")
    first, _ = named(robot, noisy(replace(log, forces=log.forces * [1.0, 1.0, 1.07, 1.0])))
    assert (first.fault, first.labels) == ("scale", ("torque3",))
    assert first.sizes[0] == pytest.approx(0.07, abs=0.01)


def test_gravity_off_its_direction_is_named():
    robot, log, _ = clean("delta")
    g = np.linalg.norm(robot.gravity)
    lean = np.radians(2.0)
    tilted = replace(robot, gravity=(g * np.sin(lean), 0.0, -g * np.cos(lean)))
    forces = log.forces + rigid(tilted, log) - rigid(robot, log)
    first, _ = named(robot, noisy(replace(log, forces=forces), noise=0.003))
    assert first.fault == "gravity"
    assert np.linalg.norm(first.sizes) == pytest.approx(lean, rel=0.2)


def rigid(robot, log):
    """Return the forces of a machine's bodies at a log's joints."""
    curve = make_interp_spline(log.time, log.joints, k=7)
    motion = tuple(curve(log.time, k) for k in range(3))
    s = States.from_joints(robot, motion, log.time, home_pose(robot))
    return pteron.inverse_dynamics(robot, s.pose, s.velocity, s.acceleration)


def test_another_geometry_is_named():
    robot, log, _ = clean("five-bar")
    legs = [replace(robot.legs[0], lower_length=1.01 * robot.legs[0].lower_length), robot.legs[1]]
    forces = log.forces + rigid(replace(robot, legs=tuple(legs)), log) - rigid(robot, log)
    first, _ = named(robot, noisy(replace(log, forces=forces), noise=0.003))
    assert first.fault == "geometry"


@CLIENTS
def test_friction_that_falls_with_speed_is_named_and_then_identified():
    robot, log, friction = clean("linear-delta", dry=0.2)
    rates = np.gradient(log.joints, log.time, axis=0)
    speed = 0.2 * float(np.sqrt((rates**2).mean()))
    more = friction.coulomb * np.sign(rates) * np.exp(-((rates / speed) ** 2))
    log = noisy(replace(log, forces=log.forces + more), noise=0.003)
    first, _ = named(robot, log)
    assert first.fault == "stribeck"
    assert "--stribeck auto" in first.message
    result = found(robot, log, terms=Terms(stribeck="auto"))
    assert "stribeck" not in result.fault_isolation.tried
    # The motion is fast: not every joint shows near rest what its friction does.
    seen = np.flatnonzero(np.isfinite(result.unknowns.speeds))
    assert len(seen)
    off = np.log(result.unknowns.speeds[seen] / speed)
    assert (np.abs(off) < 4.0 * result.unknowns.speed_deviations[seen]).all()
    places = [result.model.names.index(f"Fs{i + 1}") for i in seen]
    errors = result.estimate.values[places] - friction.coulomb[seen]
    assert (np.abs(errors) < 4.0 * result.estimate.deviations[places]).all()


def test_what_falls_with_speed_is_in_the_model_file():
    robot, log, _ = clean("linear-delta")
    result = identify(robot, noisy(log), terms=Terms(stribeck=0.01))
    falls = result.model.joint_values("stribeck", result.estimate.values)
    for leg, force in zip(result.machine.legs, falls, strict=True):
        wanted = Stribeck(force, 0.01) if force > 0.0 else None
        assert isinstance(leg.drive, Drive)
        assert leg.drive.stribeck == wanted
    with pytest.raises(pteron.ModelError, match="speeds above 0 expected"):
        Terms(stribeck=(0.1, -0.1))
    with pytest.raises(pteron.ModelError, match="2 speeds given, one expected or 3"):
        identification_model(robot, Terms(stribeck=(0.1, 0.1)))


def test_drives_that_give_are_named():
    robot, log, _ = clean("delta")
    load = rigid(robot, log)
    seconds = np.gradient(np.gradient(log.joints, log.time, axis=0), log.time, axis=0)
    stiffness = load.std(axis=0) / seconds.std(axis=0) * (2.0 * np.pi * 20.0) ** 2
    first, _ = named(robot, noisy(replace(log, joints=log.joints + load / stiffness), noise=0.003))
    assert first.fault == "elasticity"
    assert np.allclose(first.sizes * stiffness, 1.0, atol=0.5)


def test_friction_that_changes_is_named():
    robot, log, friction = clean("quadrupteron")
    rates = np.gradient(log.joints, log.time, axis=0)
    left = 1.0 - log.time / log.time[-1]
    forces = log.forces + 0.8 * friction.coulomb * np.sign(rates) * left[:, None]
    first, _ = named(robot, noisy(replace(log, forces=forces), noise=0.003))
    assert first.fault == "drift"


def test_forces_that_stand_out_do_not_spoil_the_grade():
    robot, log, _ = clean("delta")
    log = noisy(log)
    rng = np.random.default_rng(1)
    size = 0.01 * np.sqrt((log.forces**2).mean(axis=0))
    hits = (rng.random(log.forces.shape) < 0.01) * rng.choice((-30.0, 30.0), log.forces.shape)
    result = found(robot, replace(log, forces=log.forces + size * hits))
    (held,) = result.held_out
    assert (held.nrms > 2.0 * held.floor).all()
    assert (held.robust_nrms < 0.6 * held.nrms).all()
    assert (held.outliers > 0.005).all()
    assert result.verdict.grade == "trustworthy"
    assert any("outliers" in reason for reason in result.verdict.reasons)


@pytest.mark.parametrize("seed", gated(range(4), [0]))
def test_small_motion_is_not_accused_of_flipped_signs(seed):
    robot = random_machine(seed, False)
    how = brisk(robot) | {"size": 0.02 * brisk(robot)["size"], "turn": 0.01}
    log = noisy(log_of(robot, seed=seed, **how), seed)
    result = found(robot, log)
    assert result.unseen
    steps = result.verdict.next_steps
    assert any(step.startswith("Not determined by this motion") for step in steps)


@pytest.mark.parametrize("name", gated(["quadrupteron", "delta", "par4", "mixed"], ["mixed"]))
def test_columns_are_what_a_fault_does_to_the_forces(name):
    """Other joints and lengths, against the machine built anew."""
    robot, log, _ = clean(name)
    part = log.part(100, 140)
    curve = make_interp_spline(log.time, log.joints, k=7)
    motion = tuple(curve(part.time, k) for k in range(3))
    states = States.from_joints(robot, motion, part.time, home_pose(robot))
    n, rows = len(robot.legs), len(part.time)
    model = identification_model(robot, Terms(coulomb=False, viscous=False, offset=False))
    values = model.base.values(robot)
    fitted = FittedMotion(model, values, states, np.ones(n), np.zeros(rows))
    here = pteron.inverse_dynamics(robot, states.pose, states.velocity, states.acceleration)
    size = np.abs(here).max()

    step = 1e-6
    place = [leg for leg, _ in lengths_of(robot)].index(1)
    leg = robot.legs[1]
    point = (leg.guide_point[0] + step, *leg.guide_point[1:])
    legs = [replace(one, guide_point=point) if one is leg else one for one in robot.legs]
    other = replace(robot, legs=tuple(legs))
    s = States.from_joints(other, motion, part.time, tuple(states.pose[0]))
    there = pteron.inverse_dynamics(other, s.pose, s.velocity, s.acceleration)
    columns = fitted.length_slopes
    assert columns.shape[-1] == len(lengths_of(robot))
    wanted = (there - here) / step
    assert np.abs(columns[..., place] - wanted).max() < 1e-5 * size / 0.1

    behind = [np.ones_like(motion[0]), *np.zeros((2, *motion[0].shape))]
    shifted = (motion[0] - step * np.eye(len(robot.legs))[1], *motion[1:])
    s = States.from_joints(robot, shifted, part.time, tuple(states.pose[0]))
    there = pteron.inverse_dynamics(robot, s.pose, s.velocity, s.acceleration)
    wanted = (there - here) / step
    given = fitted.lag_slopes(behind)[..., 1]
    assert np.abs(given - wanted).max() < 1e-3 * np.abs(wanted).max() + 1e-5 * size


def test_every_family_names_its_columns():
    robot = machine("par4")
    model = identification_model(robot)
    values = np.ones(len(model.names))
    columns = FaultColumns(model, values, np.ones(4), 0.0, 1.0, families_of(model))
    whole = columns.extended_model
    assert len(whole.names) == len(whole.units) == len(whole.kinds)
    assert columns.places[-1].stop == len(whole.names)


def test_a_log_too_short_for_fault_isolation_is_not_refused():
    robot, log, _ = clean("delta")
    result = found(robot, noisy(log))
    (how,) = result.preprocessing
    slow = replace(how, derivatives="central", cutoff=0.5)  # its edges leave nothing
    shown = isolate_faults(
        result.model, result.estimate, [read_recording(log.part(0, 1000))], [slow]
    )
    assert (shown.tried, shown.faults) == ((), ())

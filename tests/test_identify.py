"""The whole way from logs to a verdict: what is found, and what is refused."""

import signal
import time
import weakref
from dataclasses import replace
from functools import partial

import casadi as ca
import numpy as np
import pytest
from logs_of_motions import Friction, log_of, machine, truth, without
from mechanisms import CATALOG, CLIENTS, NEAREST, gated, random_machine

import pteron
from pteron.bodies.parameters import body_places
from pteron.cli.interrupts import insistent_interrupts
from pteron.identification import (
    FaultIsolation,
    Log,
    Processing,
    Terms,
    huber,
    identification_model,
    identify,
    open_log,
    write_log,
)
from pteron.identification.exchanged_columns import ColumnFault
from pteron.identification.fit_task import STEPS
from pteron.identification.logs import Description
from pteron.identification.plausibility import has_negative_inertia
from pteron.identification.prediction import Prediction
from pteron.identification.recordings import read_recording, split_test_data
from pteron.identification.verdict import verdict_of
from pteron.manipulator import parameter_data
from pteron.workspace import home_pose

QUADRUPTERON = CATALOG["quadrupteron"]
RODS = ("delta", "mixed")
NOISE = {"joint_noise": 3e-7, "force_noise": 0.1}


def as_built(robot, seed=0):
    """Return a machine whose inertia differs from the drawing: every body denser or lighter."""
    rng = np.random.default_rng(seed)
    values = pteron.parameters(robot)
    sizes = [len(place) for place in body_places(parameter_data(robot)).values()]
    return pteron.with_parameters(robot, values * rng.uniform(0.8, 1.2, len(sizes)).repeat(sizes))


def noisy(robot, seed=0, duration=8.0, **more):
    how = {"duration": duration, "seed": seed, "noise_seed": seed}
    return log_of(robot, **how, **NOISE, **more)


LARGE = {"size": 0.15, "harmonics": 5}
"""A motion of the Delta and the mixed machine, which are larger than the others."""


FAMILY = ["linear-delta", "five-bar", "3-rrr", "delta-4", "par4"]


@pytest.mark.parametrize(
    "name",
    gated(
        [
            *("quadrupteron", "delta", "mixed", "mixed, planar", *FAMILY, "ball-table", "stewart"),
            "quadrupteron-skew",  # its type-II measure is 0.05 at best
        ],
        ["delta", "quadrupteron-skew"],
    ),
)
def test_noise_free_logs_give_back_the_machine(name):
    robot = random_machine(0, "CCL") if name == "mixed, planar" else machine(name)
    size = 0.1 * np.mean([leg.size for leg in robot.legs if leg.size])
    how = {"size": size, "harmonics": 5, "duration": 6.0}
    how |= {"turn": 0.15} if robot.platform.tilts else {}
    log, other = (log_of(as_built(robot), period=period, **how) for period in (3.0, 4.0))
    found = identify(robot, log, held_out=other)
    true = truth(identification_model(as_built(robot)))
    assert np.abs(found.estimate.values - true).max() < 1e-9 * max(1.0, np.abs(true).max())
    assert found.verdict.grade == "trustworthy"
    assert found.consistency.feasible
    base = found.model.base
    assert np.allclose(
        base.values(found.consistency.robot), found.base_values, rtol=1e-9, atol=1e-11
    )


@CLIENTS
def test_a_noisy_log_is_judged_by_another_motion():
    built = as_built(QUADRUPTERON)
    fast = [noisy(built, seed, period=2.0, size=0.06, turn=0.5) for seed in (1, 2)]
    found = identify(QUADRUPTERON, fast[0], held_out=fast[1])
    (held,) = found.held_out
    assert held.source == "log.csv"
    assert (held.nrms < 1.2 * held.floor).all()
    assert (held.nrms_without_friction > 3.0 * held.nrms).all()
    assert found.verdict.grade == "trustworthy"
    assert not any("repeats" in reason for reason in found.verdict.reasons)
    errors = (
        found.estimate.values - truth(identification_model(built))
    ) / found.estimate.deviations
    assert np.abs(errors).max() < 4.0
    assert set(found.essential.names) | set(found.essential.dropped) == set(found.model.names)
    assert found.consistency_share < 0.05


def test_a_delta_is_identified_from_a_noisy_log():
    robot = machine("delta")
    built = as_built(robot)
    # 1 % of the torques is noise.
    fast = {"size": 0.15, "harmonics": 6, "period": 2.0, "duration": 6.0, "rate": 1000.0}
    clean = log_of(built, **fast)
    noise = {"joint_noise": 1e-5, "force_noise": 0.01 * np.sqrt((clean.forces**2).mean())}
    log, other = (log_of(built, **fast, **noise, seed=k, noise_seed=k) for k in (0, 1))
    found = identify(robot, log, held_out=other)
    assert found.verdict.grade == "trustworthy"
    (held,) = found.held_out
    assert (held.nrms < 1.2 * held.floor).all()
    true = truth(identification_model(built))
    errors = (found.estimate.values - true) / found.estimate.deviations
    assert np.abs(errors).max() < 4.0
    assert found.consistency.feasible
    assert found.model.units[:2] == ("kg m", "kg m")
    assert found.model.units[-9:-3] == ("N m",) * 3 + ("N m s",) * 3


def test_the_noise_that_is_stated_is_the_noise_that_is_there():
    found = identify(QUADRUPTERON, noisy(QUADRUPTERON, 3))
    # A hundred rows or so for each actuator.
    assert np.allclose(found.estimate.noise, NOISE["force_noise"], rtol=0.25)
    assert np.allclose(found.preprocessing[0].force_noise, NOISE["force_noise"], rtol=0.15)


def resting(robot, *, seed=3, rate=1000.0):
    """Return a log of quintic moves with rests between them: acceleration has kinks."""
    time = np.arange(round(12.0 * rate)) / rate
    corners = np.random.default_rng(seed).uniform(-1.0, 1.0, (24, robot.freedom))
    corners *= np.array([0.05, 0.05, 0.05, 0.4])[: robot.freedom]
    tau = np.clip(np.remainder(time, 0.5) / 0.35, 0.0, 1.0)
    start = (time // 0.5).astype(int) % 24
    step = corners[(start + 1) % 24] - corners[start]
    law = np.stack(
        [
            tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2),
            30.0 * tau**2 * (1.0 - tau) ** 2 / 0.35,
            60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau) / 0.35**2,
        ]
    )
    pose, velocity, acceleration = law[..., None] * step
    pose = pose + corners[start] + home_pose(robot)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
    forces = pteron.inverse_dynamics(robot, pose, velocity, acceleration)
    forces = forces + Friction.of(len(robot.legs)).forces(rates)
    return Log("rests", time, pteron.inverse_kinematics(robot, pose), forces)


@CLIENTS
@pytest.mark.parametrize("period", [12.0])
def test_kinks_of_a_motion_without_noise_do_no_harm(period):
    about = Description(period=period)
    log, other = (
        replace(resting(QUADRUPTERON, seed=seed, rate=500.0), description=about) for seed in (3, 4)
    )
    found = identify(QUADRUPTERON, log, held_out=other)
    assert np.abs(found.estimate.values - truth(found.model)).max() < 1e-9


@pytest.mark.parametrize(("period", "start"), [(None, 1.7e9)])
def test_stamps_far_from_zero_do_no_harm(start, period):
    log = log_of(QUADRUPTERON, rate=500.0, description=Description(period=period))
    found = identify(QUADRUPTERON, replace(log, time=log.time + start))
    assert np.abs(found.estimate.values - truth(found.model)).max() < 1e-9


@pytest.mark.parametrize("share", [0.3])
def test_uneven_steps_do_no_harm_where_there_is_no_noise(share):
    steps = 1.0 + share * np.random.default_rng(0).uniform(-1.0, 1.0, 8000)
    found = identify(QUADRUPTERON, log_of(QUADRUPTERON, time=np.cumsum(steps) / 1000.0))
    rank = found.model.base.rank
    assert np.abs(found.estimate.values - truth(found.model))[:rank].max() < 1e-9


@pytest.mark.parametrize("share", [0.002, 0.03, 0.06])
def test_samples_that_are_lost_here_and_there_are_bridged_and_said(share):
    """Each gap cost a filter's edges: nothing was left, or a stretch of one row crashed."""
    robot = machine("delta")
    shape = {"size": 0.15, "harmonics": 6, "period": 2.0, "duration": 8.0, "rate": 500.0}
    clean = log_of(robot, **shape)
    noise = {"joint_noise": 1e-5, "force_noise": 0.01 * np.sqrt((clean.forces**2).mean())}
    logs = []
    for seed in (0, 1):
        log = log_of(robot, **shape, **noise, seed=seed, noise_seed=seed)
        rows = np.random.default_rng(seed).random(log.rows) < share
        logs.append(log.drop_samples(rows))
    found = identify(robot, logs[0], held_out=logs[1])
    assert found.verdict.grade == "trustworthy"
    assert any("are bridged by polynomials" in finding.message for finding in found.findings)
    named = [cause for cause in found.causes if "are missing (lost)" in cause]
    assert len(named) == (share > 0.01)
    true = truth(identification_model(robot))
    assert np.abs((found.estimate.values - true) / found.estimate.deviations).max() < 4.5


def test_a_long_gap_is_no_sample_that_is_lost():
    log = noisy(QUADRUPTERON)
    found = identify(QUADRUPTERON, without(log, 800, 1000))
    assert not any("missing" in cause for cause in found.causes)
    assert not any("bridged" in finding.message for finding in found.findings)


def test_a_wrong_period_is_named():
    refused(noisy(QUADRUPTERON), "period: 30 s given, but", processing=Processing(period=30.0))
    log = noisy(QUADRUPTERON, description=Description(period=2.7))
    refused(log, "does not repeat after its period of 2.7 s")


def test_forces_that_are_noise_are_not_trusted():
    log = noisy(QUADRUPTERON)
    noise = np.random.default_rng(0).normal(size=log.forces.shape)
    judged = prediction((0.99, 0.99), (0.99, 0.99))
    assert verdict_of([judged], repeats=False).grade == "not trustworthy"
    with pytest.raises(pteron.DataError, match="cannot be seen"):
        identify(QUADRUPTERON, replace(log, forces=100.0 * noise))


@pytest.mark.parametrize("slider", [2])
def test_the_flipped_sign_of_a_slider_is_found(slider):
    log = noisy(QUADRUPTERON)
    signs = np.ones(4)
    signs[slider] = -1.0
    refused(replace(log, joints=signs * log.joints), f"rho{slider + 1} has the sign flipped")


def test_without_other_logs_the_end_is_held_out_and_said():
    found = identify(QUADRUPTERON, noisy(QUADRUPTERON, 1))
    assert any("repeat the motion" in reason for reason in found.verdict.reasons)
    assert any("Record another motion" in step for step in found.verdict.next_steps)


def test_a_periodic_log_is_divided_at_its_periods():
    log = noisy(QUADRUPTERON, duration=12.0, description=Description(period=4.0))
    fit, check = split_test_data(read_recording(log), 4.0)
    assert (fit.rows, check.rows) == (2400, 1200)
    found = identify(QUADRUPTERON, log)
    assert found.preprocessing[0].derivatives == "periodic"
    assert found.verdict.grade == "trustworthy"


@pytest.mark.parametrize(
    "estimator", ["ordinary", "weighted", "huber", "total", "instrumental", "likelihood"]
)
def test_every_estimator_serves(estimator):
    found = identify(CATALOG["tripteron"], noisy(CATALOG["tripteron"]), estimator=estimator)
    errors = found.estimate.values - truth(found.model)
    assert (np.abs(errors) < 5.0 * found.estimate.deviations).all()
    assert found.estimate.method == estimator
    assert found.estimate.converged
    assert not found.notes


def test_an_estimate_that_has_not_settled_is_noted():
    hasty = partial(huber, iterations=2)
    found = identify(CATALOG["tripteron"], noisy(CATALOG["tripteron"]), estimator=hasty)
    assert not found.estimate.converged
    assert "huber has not converged in 2 iterations" in found.notes[0]
    assert found.as_dict()["estimate"]["converged"] is False


def test_an_unknown_estimator_is_refused_with_the_known_ones():
    with pytest.raises(pteron.ModelError, match="'best' is not one of ordinary, weighted"):
        identify(QUADRUPTERON, noisy(QUADRUPTERON), estimator="best")


def test_known_rotors_are_no_part_of_the_bodies():
    inertia, ratio = (2e-5, 1e-5, 1e-5, 1e-5), (200.0,) * 4
    masses = np.array(inertia) * np.array(ratio) ** 2
    log = log_of(QUADRUPTERON)
    pose_log = identify(QUADRUPTERON, log)
    rates = _slider_accelerations(QUADRUPTERON, log)
    driven = replace(
        log,
        forces=log.forces + masses * rates,
        description=Description(rotor_inertia=inertia, ratio=ratio),
    )
    found = identify(QUADRUPTERON, driven)
    # The first guide is vertical: gravity pulls at a slider's mass, not at a rotor.
    assert found.estimate.value("m_p1") == pytest.approx(
        pose_log.estimate.value("m_p1") + masses[0], abs=1e-6
    )
    assert found.estimate.value("offset1") == pytest.approx(
        pose_log.estimate.value("offset1") - 9.81 * masses[0], abs=1e-5
    )
    assert "J_m1" in found.model.expressions[found.model.names.index("m_p1")]
    assert np.allclose(
        pteron.parameters(found.consistency.robot),
        pteron.parameters(pose_log.consistency.robot),
        atol=1e-5,
    )


def _slider_accelerations(robot, log):
    from pteron.identification.signals import spline_motion

    return spline_motion(log.time, log.joints, None)[2]


@pytest.mark.parametrize("name", ["quadrupteron", "mixed", "delta-4", "3-rrr"])
def test_passive_joints_are_identified(name):
    robot = machine(name)
    log = log_of(robot, **LARGE) if name in (*RODS, "delta-4") else log_of(robot)
    model = identification_model(robot, Terms(passive="each"))
    from pteron.identification import observations_of, preprocessing_for_log

    equations = observations_of(model, log, preprocessing_for_log(robot, log))
    # The legs' R3 of rods turns as R2 does; the shaft's two universal joints turn alike.
    passive = model.kinds.count("passive")
    assert passive == {"quadrupteron": 13, "mixed": 9, "delta-4": 12, "3-rrr": 6}[name]
    units = {term.unit for term in model.kept_terms if term.kind == "passive"}
    assert units == ({"N m s", "N s/m"} if name == "delta-4" else {"N m s"})
    truths = np.r_[truth(identification_model(robot)), np.full(passive, 0.05)]
    found = np.linalg.lstsq(
        equations.matrix.reshape(-1, len(truths)), (equations.matrix @ truths).ravel(), rcond=None
    )[0]
    assert np.abs(found - truths).max() < 1e-8


# What is refused -----------------------------------------------------------------------------


def refused(log, *words, robot=QUADRUPTERON, **options):
    with pytest.raises(pteron.DataError) as caught:
        identify(robot, log, **options)
    text = str(caught.value)
    reason = getattr(caught.value, "reason", None)
    assert reason is None or text.startswith(f"{caught.value.place}: ")
    assert "\n" not in text
    for word in words:
        assert word in text, text
    return reason


def test_flipped_forces_are_found():
    log = noisy(QUADRUPTERON)
    reason = refused(replace(log, forces=-log.forces), "sign flipped", "negative inertia")
    assert reason == "columns"


def test_columns_of_cranks_are_called_by_their_names():
    robot = machine("mixed")
    log = log_of(robot, duration=12.0, force_noise=0.1, **LARGE)
    forces, joints = log.forces.copy(), log.joints.copy()
    forces[:, 1] *= -1.0
    refused(replace(log, forces=forces), "torque2 has the sign flipped", robot=robot)
    joints[:, [1, 2]] = joints[:, [2, 1]]
    refused(replace(log, joints=joints), "theta2 and theta3 are swapped", robot=robot)


@pytest.mark.parametrize("actuator", [1])
def test_one_flipped_force_is_found(actuator):
    log = noisy(QUADRUPTERON)
    signs = np.ones(4)
    signs[actuator] = -1.0
    refused(replace(log, forces=signs * log.forces), f"force{actuator + 1} has the sign flipped")


@pytest.mark.parametrize("pair", [(1, 3)])
def test_swapped_forces_are_found(pair):
    log = noisy(QUADRUPTERON)
    order = list(range(4))
    order[pair[0]], order[pair[1]] = order[pair[1]], order[pair[0]]
    names = f"force{pair[0] + 1} and force{pair[1] + 1} are swapped"
    refused(replace(log, forces=log.forces[:, order]), names)


@pytest.mark.parametrize("pair", [(0, 1)])
def test_swapped_sliders_are_found(pair):
    log = noisy(QUADRUPTERON)
    order = list(range(4))
    order[pair[0]], order[pair[1]] = order[pair[1]], order[pair[0]]
    changed = replace(log, joints=log.joints[:, order])
    refused(changed, f"rho{pair[0] + 1} and rho{pair[1] + 1}", "swapped")


def test_swaps_are_found_without_noise_too():
    robot = CATALOG["delta"]
    log = log_of(robot)
    refused(replace(log, forces=log.forces[:, [1, 0, 2]]), "swapped", "vanishes", robot=robot)


def test_swaps_are_found_on_three_legs_too():
    robot = CATALOG["tripteron-oblique"]
    log = noisy(robot)
    refused(replace(log, forces=log.forces[:, [0, 2, 1]]), "force2 and force3", robot=robot)


def test_a_sound_log_is_not_accused():
    robot = random_machine(1, False)
    log = noisy(robot, size=0.03, turn=0.2, period=1.7)
    found = identify(robot, log)
    assert found.fault_isolation.faults == ()
    assert found.verdict.grade != "not trustworthy"


def test_what_too_little_motion_does_not_show_stays_near_the_drawing():
    log = noisy(QUADRUPTERON, size=2e-4, turn=1e-3)
    found = identify(QUADRUPTERON, log)
    base = found.model.base
    assert "mgx_u2" in found.unseen
    steps = [step for step in found.verdict.next_steps if step.startswith("Not determined by")]
    assert len(steps) == 1
    assert "mgx_u2" in steps[0]
    # Of usual size, not a thousand times as large, and its interval says that it is not known.
    k = base.names.index("mgx_u2")
    assert abs(found.base_values[k] - base.values(QUADRUPTERON)[k]) < found.estimate.deviations[k]
    assert abs(found.base_values[k]) < 3.0 * abs(base.values(QUADRUPTERON)[k])


def test_motion_along_one_axis_names_what_is_not_seen():
    robot = QUADRUPTERON
    time = np.arange(6000) / 500.0
    pose = np.zeros((len(time), 4))
    pose[:, 2] = 0.05 * np.sin(2.0 * time)
    velocity, acceleration = np.zeros_like(pose), np.zeros_like(pose)
    velocity[:, 2], acceleration[:, 2] = 0.1 * np.cos(2.0 * time), -0.2 * np.sin(2.0 * time)
    log = replace(
        log_of(robot, time=time),
        joints=pteron.inverse_kinematics(robot, pose),
        forces=pteron.inverse_dynamics(robot, pose, velocity, acceleration),
    )
    refused(log, "too little motion", "I_u1", processing=Processing(slow=0.0))


def test_the_log_of_another_machine_is_refused_by_its_row():
    log = log_of(QUADRUPTERON)
    away = replace(log, joints=log.joints + np.array([0.0, 0.3, 0.0, -0.3]))
    refused(away, "no pose of quadrupteron has the joints", "row", "another machine")


def test_a_log_too_short_says_how_much_is_needed():
    log = noisy(QUADRUPTERON).part(0, 80)
    assert refused(log, "rows", "record longer") == "too short"


def test_what_is_no_force_is_refused_by_row():
    log = noisy(QUADRUPTERON)
    for value in (1e200, np.nan, np.inf):
        forces = log.forces.copy()
        forces[1500, 1] = value
        refused(replace(log, forces=forces), "row 1501, column force2", "is no force")


def test_what_is_fitted_is_not_held_out():
    log = noisy(QUADRUPTERON)
    with pytest.raises(pteron.DataError, match="is held out, but the same samples are fitted"):
        identify(QUADRUPTERON, log, held_out=[noisy(QUADRUPTERON, 1), log])
    with pytest.raises(pteron.DataError, match="the same samples as log"):
        identify(QUADRUPTERON, [log, replace(log, source="copy.csv")])


def test_a_payload_needs_its_column():
    refused(noisy(QUADRUPTERON), "no payload column", terms=Terms(payload=True))


def test_a_model_that_leaves_too_much_is_said_to():
    terms = Terms(coulomb=False, viscous=False, offset=False)
    found = identify(QUADRUPTERON, noisy(QUADRUPTERON), terms=terms)
    assert found.verdict.grade != "trustworthy"
    said = (*found.causes, *found.verdict.reasons)
    assert any("friction" in one.lower() for one in said)


def test_sliders_in_any_order_are_found():
    log = noisy(QUADRUPTERON)
    refused(replace(log, joints=log.joints[:, [0, 2, 3, 1]]), "rho", "in another order")


def test_one_wild_force_is_no_flipped_sign():
    log = noisy(QUADRUPTERON, rate=500.0)
    forces = log.forces.copy()
    forces[2100, 1] = 1e9
    with pytest.raises(pteron.DataError) as caught:
        identify(QUADRUPTERON, replace(log, forces=forces))
    assert "sign" not in str(caught.value)


@CLIENTS
def test_values_far_from_the_drawing_are_doubted():
    legs = [
        replace(leg, elbow=-leg.elbow) if i == 2 else leg for i, leg in enumerate(QUADRUPTERON.legs)
    ]
    other = replace(QUADRUPTERON, legs=tuple(legs))
    found = identify(other, noisy(QUADRUPTERON, rate=500.0))
    assert any("Far from the drawn machine" in step for step in found.verdict.next_steps)
    found = identify(QUADRUPTERON, noisy(as_built(QUADRUPTERON)))
    assert not any("Far from" in step for step in found.verdict.next_steps)


def test_currents_without_gains_are_refused():
    log = replace(log_of(QUADRUPTERON), description=Description(column_force_unit="A"))
    refused(log, "forces are in A", "gains")


# Judgement -----------------------------------------------------------------------------------


def test_what_is_no_number_is_not_trusted():
    judged = prediction((0.01, np.nan), (0.01, 0.01))
    assert verdict_of([judged], repeats=False).grade == "not trustworthy"


def prediction(error, noise, friction=5.0):
    size = np.ones(2)
    empty = np.empty((0, 2))
    return Prediction(
        "a.csv",
        1000,
        np.zeros(2),
        size,
        np.array(error),
        friction * np.array(error),
        np.array(error),
        np.array(error),
        np.zeros(2),
        np.array(noise),
        np.empty(0),
        empty,
        empty,
        empty,
        empty,
        empty > 0,
    )


@pytest.mark.parametrize(
    ("error", "noise", "grade"),
    [
        ((0.011, 0.01), (0.01, 0.01), "trustworthy"),
        ((0.30, 0.01), (0.25, 0.01), "trustworthy"),  # noise is all there is
        ((0.04, 0.01), (0.001, 0.01), "trustworthy"),  # little is missed
        ((0.10, 0.01), (0.001, 0.01), "usable with care"),
        ((0.01, 0.50), (0.001, 0.01), "not trustworthy"),
    ],
)
def test_the_grade_is_that_of_the_worst_actuator(error, noise, grade):
    verdict = verdict_of([prediction(error, noise)], repeats=False)
    assert verdict.grade == grade
    assert ("worst" in " ".join(verdict.reasons)) == (grade != "trustworthy")


def test_a_trusted_error_above_the_noise_is_told_beside_it():
    told, quiet = (
        " ".join(verdict_of([prediction((0.04, 0.01), noise)], repeats=False).reasons)
        for noise in ((0.02, 0.01), (0.03, 0.01))
    )
    expected = "misses 3.5 % of the force of actuator 1; up to 5 % is trustworthy (the error is 2 "
    assert expected in told
    assert "times the noise" not in quiet


@pytest.mark.parametrize(
    ("small", "words"),
    [
        ((), "No fault shows in the residuals; tested: a delay, a wrong length or point"),
        (
            (("geometry", 0.02),),
            "No fault that matters shows in the residuals: a wrong length or point of the geometry "
            "changes the forces of a cycle by up to 0.02 % (below the threshold of 0.05 %); tested",
        ),
        ((("geometry", 0.2),), "by up to 0.2 % (a negligible size); tested"),
    ],
)
def test_a_fault_that_is_too_small_to_matter_is_named(small, words):
    shares = np.zeros((2, 2))
    faults = FaultIsolation(("delay", "geometry"), (), *shares, small=small)
    verdict = verdict_of([prediction((0.01, 0.01), (0.01, 0.01))], faults, repeats=False)
    assert verdict.grade == "trustworthy"
    assert words in " ".join(verdict.reasons)


@pytest.mark.parametrize(
    ("uncertain", "spoiled", "grade"),
    [
        (1.0, 2.0, "trustworthy"),
        (4.0, 0.0, "usable with care"),
        (0.5, 12.0, "usable with care"),
        (0.5, 16.0, "not trustworthy"),
        (np.nan, np.nan, "trustworthy"),  # no room for a cycle
    ],
)
def test_what_is_left_open_of_a_cycle_counts(uncertain, spoiled, grade):
    good, shares = prediction((0.01, 0.01), (0.01, 0.01)), np.array([[0.1, 0.1]] * 2)
    shares[:, 1] = uncertain, spoiled
    verdict = verdict_of([good], FaultIsolation(("delay",), (), *shares), repeats=False)
    assert verdict.grade == grade
    steps = " ".join(verdict.next_steps)
    assert ("does not determine the forces of such a cycle" in steps) == (uncertain == 4.0)


def test_the_worst_recording_decides():
    good, bad = prediction((0.01, 0.01), (0.01, 0.01)), prediction((0.5, 0.5), (0.01, 0.01))
    assert verdict_of([good, bad, good], repeats=False).grade == "not trustworthy"


@CLIENTS
def test_wrong_geometry_is_not_trusted():
    built = replace(
        QUADRUPTERON,
        legs=tuple(replace(leg, lower_length=1.15 * leg.lower_length) for leg in QUADRUPTERON.legs),
    )
    found = identify(
        QUADRUPTERON,
        log_of(built, size=0.08, turn=0.6, force_noise=0.01),
        held_out=log_of(built, size=0.08, turn=0.6, seed=2, force_noise=0.01),
    )
    assert found.verdict.grade != "trustworthy"


@CLIENTS
def test_negative_inertia_is_seen_on_every_machine():
    for robot in (CATALOG[name] for name in NEAREST):
        model = identification_model(robot)
        values, exact = truth(model), np.zeros((len(model.names), len(model.names)))
        assert not has_negative_inertia(model, values, exact)
        assert has_negative_inertia(model, -values, exact)
        # What may be chance is no finding.
        assert not has_negative_inertia(model, -values, np.diag(values**2))


def test_a_fault_says_what_is_wrong():
    names = [tuple(f"{name}{i}" for i in (1, 2, 3)) for name in ("force", "rho")]
    fault = ColumnFault(*names, (1, 2, 0), (1, 1, -1), (0, 1, 2), (1, 1, 1), 0.5, 0.01)
    text = fault.message()
    assert "force1, force2 and force3 are in another order" in text
    assert "force1 has the sign flipped" in text


# Interrupts ----------------------------------------------------------------------------------


def test_an_interrupt_in_a_callback_of_a_weak_reference_gets_through():
    class Target:
        pass

    def work():
        target = Target()
        # Whatever a callback raises is dropped by Python; here Ctrl-C comes while it runs.
        watched = weakref.ref(target, lambda _: signal.raise_signal(signal.SIGINT))
        del target
        assert watched() is None
        end = time.monotonic() + 5.0
        while time.monotonic() < end:
            time.sleep(0.01)

    with pytest.raises(KeyboardInterrupt), insistent_interrupts():
        work()
    with pytest.raises(KeyboardInterrupt), insistent_interrupts():
        raise ImportError("initialization failed") from KeyboardInterrupt()


def test_an_error_that_an_extension_makes_of_an_interrupt_is_an_interrupt():
    def build():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ValueError("a part could not be built") from None

    with pytest.raises(KeyboardInterrupt), insistent_interrupts():
        build()


def test_an_interrupt_in_casadi_gets_through_once_its_call_is_over():
    def interrupted(_):
        signal.raise_signal(signal.SIGINT)
        return ca.SX(0)

    # CasADi asks a value for its expression as it looks which form of a function fits, and drops
    # what is raised there: its call would fail.
    value = type("Value", (), {"__SX__": interrupted})()
    done = []

    def work():
        done.append(ca.sin(value))
        time.sleep(5.0)
        done.append("slept to the end")

    with pytest.raises(KeyboardInterrupt), insistent_interrupts():
        work()
    assert len(done) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    time.sleep(0.05)  # no second interrupt comes


# Files ---------------------------------------------------------------------------------------


@CLIENTS
def test_a_file_in_pieces_gives_what_the_log_in_memory_gives(tmp_path):
    log = noisy(QUADRUPTERON)
    path = write_log(log, tmp_path / "log.parquet")
    # Cut-offs, and what is slow, would be found from the first piece.
    pinned = Processing(derivatives="central", cutoff=20.0, band=20.0, slow=0.0)
    whole = identify(QUADRUPTERON, open_log(path, QUADRUPTERON), processing=pinned)
    file = open_log(path, QUADRUPTERON)
    file.rows_in_memory, file.rows_in_piece = 100, 1700
    told = []
    streamed = identify(
        QUADRUPTERON,
        file,
        processing=pinned,
        progress=told.append,
    )
    off = np.abs(streamed.estimate.values - whole.estimate.values) / whole.estimate.deviations
    assert off.max() < 1e-3
    assert streamed.verdict.grade == whole.verdict.grade
    assert set(STEPS) <= {getattr(share, "step", "") for share in told}
    assert (told[-1], told == sorted(told)) == (1.0, True)
    assert len(set(told)) > len(STEPS)


def test_results_are_plain_data():
    import json

    found = identify(CATALOG["tripteron"], noisy(CATALOG["tripteron"]))
    data = json.loads(json.dumps(found.as_dict()))
    assert data["verdict"]["grade"] == "trustworthy"
    assert len(data["estimate"]["values"]) == len(found.model.names)
    assert Friction.of(3).values.shape == (9,)

"""The model's columns, and the observations that a log gives."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from logs_of_motions import Friction, log_of, machine, motion, pieces, truth, without
from mechanisms import CATALOG, MECHANISMS, relative_error, states

import pteron
from pteron.errors import DataError, ModelError
from pteron.identification.estimators import ordinary
from pteron.identification.logs import Description
from pteron.identification.model import Terms, identification_model
from pteron.identification.observation import motion_mask, observations_of, stack_observations
from pteron.identification.signals import Processing, States, preprocessing_for_log

KINDS = ["quadrupteron turned", "delta on a wall"]
each_kind = pytest.mark.parametrize("name", KINDS)


@lru_cache(maxsize=32)
def model_of(name, terms=Terms()):  # noqa: B008
    return identification_model(machine(name), terms)


def states_of(robot, count=60, payload=0):
    """Return random states as the equations see them."""
    pose, velocity, acceleration = states(robot, count)
    rates = pteron.kinematics.joint_rates(robot, pose, velocity)
    accelerations = pteron.kinematics.joint_accelerations(robot, pose, velocity, acceleration)
    sliders = pteron.inverse_kinematics(robot, pose)
    phases = np.full(count, payload)
    return States(
        np.arange(float(count)),
        sliders,
        rates.actuated,
        accelerations.actuated,
        pose,
        velocity,
        acceleration,
        phases,
    )


# The model

TERMS = {
    "no friction": Terms(coulomb=False, viscous=False, offset=False),
    "joints": Terms(),
    "joints alike": Terms(passive="shared"),
    "joints each": Terms(passive="each"),
    "rotors": Terms(rotors=True),
    "everything": Terms(passive="each", rotors=True),
}


@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
@pytest.mark.parametrize("kind", TERMS)
def test_a_model_names_every_column_once(name, kind):
    terms = TERMS[kind]
    model = model_of(name, terms)
    robot = model.robot
    n = len(robot.legs)
    joints = {"none": 0, "shared": 3 + robot.platform.turns, "each": 3 * n + robot.platform.turns}
    extra = n * (terms.coulomb + terms.viscous + terms.offset) + joints[terms.passive]
    assert model.merged_terms == tuple(f"J_m{i + 1}" for i in range(n) if terms.rotors)
    assert len(set(model.names)) == len(model.names) == model.base.rank + extra
    assert len(model.units) == len(model.expressions) == len(model.names)
    assert model.matrix(states_of(robot)).shape == (60, n, len(model.names))
    sliders = [("N", terms.coulomb), ("N s/m", terms.viscous), ("N", terms.offset)]
    assert model.units[model.base.rank :] == (
        *(unit for unit, taken in sliders for _ in range(n * taken)),
        *("N m s",) * joints[terms.passive],
    )
    usual = {"m": "kg", "mgx": "kg m", "mgy": "kg m", "I": "kg m^2"}
    kinds = [name.split("_")[0] for name in model.base.names]
    assert model.units[: model.base.rank] == tuple(usual[kind] for kind in kinds)


@each_kind
def test_the_columns_add_up_to_the_forces(name):
    robot = MECHANISMS[name]
    model = model_of(name)
    at = states_of(robot)
    forces = pteron.inverse_dynamics(robot, at.pose, at.velocity, at.acceleration)
    forces = forces + Friction.of(len(robot.legs)).forces(at.joint_rates)
    assert relative_error(model.matrix(at) @ truth(model), forces) < 1e-10


@each_kind
def test_columns_of_the_base_are_those_of_the_regressor(name):
    robot = MECHANISMS[name]
    model = model_of(name)
    at = states_of(robot)
    whole = pteron.regressor(robot, at.pose, at.velocity, at.acceleration)
    values = np.random.default_rng(0).normal(size=whole.shape[-1])
    base = model.base.grouping @ values
    found = model.matrix(at)[..., : model.base.rank] @ base
    assert relative_error(found, whole @ values) < 1e-9


@pytest.mark.parametrize("name", ["quadrupteron"])
def test_legs_that_share_their_values_have_fewer(name):
    robot = CATALOG[name]
    base = pteron.base_parameters(robot, shared=True)
    model = identification_model(robot, base=base)
    assert model.base.rank < model_of(name).base.rank
    alike = replace(
        robot,
        legs=tuple(
            replace(
                leg,
                slider_mass=robot.legs[0].slider_mass,
                upper=robot.legs[0].upper,
                lower=robot.legs[0].lower,
            )
            for leg in robot.legs
        ),
    )
    at = states_of(alike)
    forces = pteron.inverse_dynamics(alike, at.pose, at.velocity, at.acceleration)
    values = pteron.base_parameters(alike, shared=True).values(alike)
    assert relative_error(model.matrix(at)[..., : base.rank] @ values, forces) < 1e-9
    assert len(model.units) == len(model.names)


@pytest.mark.parametrize("name", ["quadrupteron"])
def test_shared_joints_are_the_sums_of_each(name):
    n = len(CATALOG[name].legs)
    at = states_of(CATALOG[name])
    shared, each = (model_of(name, Terms(passive=kind)) for kind in ("shared", "each"))
    start = shared.base.rank + 3 * n
    parts = each.matrix(at)[..., start : start + 3 * n]
    sums = parts.reshape(60, n, n, 3).sum(axis=-2)
    assert shared.matrix(at)[..., start : start + 3] == pytest.approx(sums, abs=1e-12)
    assert shared.names[start : start + 3] == ("Fv_R1", "Fv_R2", "Fv_R3")


@pytest.mark.parametrize("name", ["quadrupteron-oblique"])
def test_the_payload_is_a_body_more_on_the_platform(name):
    robot = CATALOG[name]
    model = model_of(name, Terms(payload=True))
    load = np.array([0.7, 0.01, -0.02, 0.003])
    values = pteron.parameters(robot)
    values[-4:] += load
    heavy = pteron.with_parameters(robot, values)
    at = states_of(robot, payload=1)
    motion_of = at.pose, at.velocity, at.acceleration
    weight = pteron.inverse_dynamics(heavy, *motion_of) - pteron.inverse_dynamics(robot, *motion_of)
    assert relative_error(model.matrix(at)[..., -4:] @ load, weight) < 1e-9
    assert not model.matrix(states_of(robot, payload=0))[..., -4:].any()


@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique", "mixed"])
def test_a_rotor_joins_what_acts_like_it(name):
    plain, driven = (model_of(name, Terms(rotors=flag)) for flag in (False, True))
    assert plain.names == driven.names
    at = states_of(machine(name))
    for i in range(len(driven.robot.legs)):
        rotor = f"J_m{i + 1}"
        assert any(rotor in expression for expression in driven.expressions)
        felt = driven.matrix(at) @ driven.share_of(rotor, 0.7)
        expected = np.zeros_like(felt)
        expected[:, i] = 0.7 * at.joint_accelerations[:, i]
        assert np.abs(felt - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_payload_shows_its_mass_only_where_the_platform_does_not_turn():
    model = model_of("tripteron", Terms(payload=True))
    assert len(model.merged_terms) == 3
    assert model.matrix(states_of(model.robot, payload=1)).any(axis=(0, 1)).all()


def test_terms_that_cannot_be_are_refused():
    with pytest.raises(ModelError, match="none, shared, each"):
        Terms(passive="all")


# Logs without noise

WAYS = {"periodic": 1e-9, "spline": 1e-8, "central": 1e-8}
SOME = ["quadrupteron", "tripteron-oblique"]


def equations_and_truth(name, derivatives="central", *, processing=None, **log):
    """Return the log, its equations and the values that made it."""
    model = model_of(name)
    made = log_of(MECHANISMS[name], **log)
    period = log.get("period", 4.0) if derivatives == "periodic" else None
    wanted = replace(processing or Processing(), derivatives=derivatives, period=period)
    treatment = preprocessing_for_log(MECHANISMS[name], made, wanted)
    return made, treatment, observations_of(model, made, treatment), truth(model)


@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize("derivatives", WAYS)
def test_a_log_without_noise_gives_the_values(name, derivatives):
    _, _, equations, values = equations_and_truth(name, derivatives)
    estimate = ordinary(equations)
    size = np.sqrt((equations.matrix**2).sum(axis=(0, 1)) / equations.rows)
    usual = np.sqrt((equations.forces**2).sum() / equations.rows)
    error = np.abs(estimate.values - values)
    assert (error * size).max() < WAYS[derivatives] * usual
    assert np.abs(equations.forces - equations.matrix @ values).max() < WAYS[derivatives] * usual


@pytest.mark.parametrize("name", ["tripteron-oblique"])
@pytest.mark.parametrize(("rate", "period"), [(50.0, 4.0), (500.0, 3.7013)])
def test_a_period_need_not_be_a_number_of_samples(name, rate, period):
    _, _, equations, values = equations_and_truth(name, "periodic", rate=rate, period=period)
    assert equations.rows > 140
    assert np.abs(equations.forces - equations.matrix @ values).max() < 1e-9


@pytest.mark.parametrize("name", ["tripteron"])
def test_periods_with_uneven_samples_and_a_gap_are_exact(name):
    model = model_of(name)
    rng = np.random.default_rng(1)
    time = np.arange(4000) / 500.0 + rng.uniform(-4e-4, 4e-4, 4000)
    log = without(log_of(MECHANISMS[name], time=time), 700, 900)
    treatment = preprocessing_for_log(
        MECHANISMS[name], log, Processing(derivatives="periodic", period=4.0, cutoff=12.0)
    )
    equations = observations_of(model, log, treatment)
    assert equations.rows > 140
    assert np.abs(equations.forces - equations.matrix @ truth(model)).max() < 1e-7


def test_a_gap_that_no_other_period_fills_is_refused():
    log = without(log_of(CATALOG["quadrupteron"], duration=4.0), 300, 900)
    processing = Processing(derivatives="periodic", period=4.0)
    with pytest.raises(DataError, match="samples leave"):
        preprocessing_for_log(CATALOG["quadrupteron"], log, processing)


# What is left out


@pytest.mark.parametrize("derivatives", WAYS)
def test_slow_sliders_are_left_out_on_both_sides(derivatives):
    # Friction that is wrong only at low speed must not be felt at all.
    name = "tripteron-oblique"
    processing = Processing(slow=0.2)
    log, treatment, equations, values = equations_and_truth(
        name, derivatives, processing=processing
    )
    pose, velocity, _ = motion(MECHANISMS[name], log.time)
    rates = pteron.kinematics.joint_rates(MECHANISMS[name], pose, velocity).actuated
    stuck = np.abs(rates) < 0.95 * treatment.slow
    assert stuck.mean() > 0.03
    spoiled = replace(log, forces=log.forces + 50.0 * stuck)
    found = observations_of(model_of(name), spoiled, treatment)
    assert np.array_equal(found.gain, equations.gain)
    assert found.forces == pytest.approx(equations.forces, abs=1e-9)
    assert np.abs(found.forces - found.matrix @ values).max() < 1e-7
    awake = replace(treatment, slow=np.zeros(3))
    assert (
        np.abs(
            observations_of(model_of(name), spoiled, awake).forces
            - observations_of(model_of(name), log, awake).forces
        ).max()
        > 1.0
    )


def test_equations_that_are_not_used_are_zero():
    _, _, equations, _ = equations_and_truth("tripteron", processing=Processing(slow=0.5))
    unused = equations.gain == 0.0
    assert 0.05 < unused.mean() < 0.95
    assert not equations.matrix[unused].any()
    assert not equations.forces[unused].any()
    assert np.array_equal(equations.equation_counts, (~unused).sum(axis=0))
    assert equations.rows == (~unused).sum()


def test_rows_near_a_slow_one_are_left_out_as_far_as_the_filter_reaches():
    found = equations_and_truth("tripteron")[1]
    treatment = replace(found, cutoff=30.0, rate=100.0, slow=np.full(1, 0.5), stroke=10.0)
    assert replace(treatment, stroke=0.12).settling_rows == 3  # a share of the stroke at most
    assert treatment.settling_rows == 5
    assert (
        replace(treatment, cutoff=10.0).turning_rows == 1
    )  # less, where the way it moves counts alone
    rates = np.ones((50, 1))
    rates[20] = 0.1
    rates[0] = 0.0
    still = np.flatnonzero(motion_mask(rates, treatment.slow, 5)[:, 0] == 0.0)
    assert np.array_equal(still, [0, 1, 2, 3, 4, 5, *range(15, 26)])
    still = np.flatnonzero(motion_mask(rates, treatment.slow, 5, wraps=True)[:, 0] == 0.0)
    assert np.array_equal(still, [0, 1, 2, 3, 4, 5, *range(15, 26), 45, 46, 47, 48, 49])


# Noise


@pytest.mark.parametrize("case", ["central", "periodic", "periodic, uneven"])
def test_what_is_left_of_noise_has_the_size_of_the_noise(case):
    # Unit noise on the forces, on masked rows and on whole ones.
    name, draws = "tripteron", 30
    derivatives = case.split(",")[0]
    shape = {"rate": 100.0, "duration": 12.0, "period": 3.9007 if "uneven" in case else 4.0}
    log, treatment, equations, _ = equations_and_truth(
        name, derivatives, processing=Processing(slow=0.1), **shape
    )
    rng = np.random.default_rng(2)
    squares = np.zeros_like(equations.gain)
    neighbours = 0.0
    model = model_of(name)
    for _ in range(draws):
        noise = rng.normal(size=log.forces.shape)
        noisy = observations_of(model, replace(log, forces=log.forces + noise), treatment)
        rest = noisy.forces - equations.forces
        squares += rest**2 / draws
        neighbours += (rest[1:] * rest[:-1]).sum() / (rest**2).sum() / draws
    used = equations.gain > 0.0
    assert np.sqrt(squares[used].mean()) == pytest.approx(1.0, abs=0.04)
    # Each equation, masked in part or not: a chi-square of so many draws.
    assert squares[used].min() > 0.2
    assert squares[used].max() < 2.5
    partial = used & (equations.gain < 0.95 * equations.gain.max())
    assert partial.sum() > 10
    assert np.sqrt(squares[partial].mean()) == pytest.approx(1.0, abs=0.1)
    assert abs(neighbours) < 0.15


# Streams


@pytest.mark.parametrize(("derivatives", "size"), [("central", 57), ("spline", 1000)])
def test_pieces_give_the_equations_of_the_whole(derivatives, size):
    name = "tripteron"
    log = log_of(CATALOG[name], joint_noise=1e-6 * (derivatives == "central"))
    log = without(log, 1200, 1230)
    log = replace(log, payload=(np.arange(log.rows) > 1600).astype(int))
    wanted = Processing(derivatives=derivatives, cutoff=25.0, slow=0.2)
    treatment = preprocessing_for_log(CATALOG[name], log, wanted)
    assert treatment.settling_rows > 5
    whole = observations_of(model_of(name), log, treatment)
    parts = observations_of(model_of(name), pieces(log, size), treatment, block=400)
    assert parts.time == pytest.approx(whole.time, abs=1e-9)
    assert np.array_equal(parts.payload, whole.payload)
    assert len(set(whole.payload)) == 2
    # A mask that starts a sample sooner or later is the noise of the positions, not of the blocks.
    same = np.isclose(parts.gain, whole.gain, rtol=1e-9, atol=0.0)
    assert same.mean() > 0.995
    scale = np.abs(whole.matrix).max(axis=(0, 1))
    assert (np.abs(parts.matrix - whole.matrix) / scale)[same].max() < 1e-6
    assert np.abs(parts.forces - whole.forces)[same].max() < 1e-6 * np.abs(whole.forces).max()


def test_stacked_equations_are_those_of_both():
    _, _, equations, values = equations_and_truth("tripteron")
    both = stack_observations([equations, equations])
    assert both.rows == 2 * equations.rows
    assert ordinary(both).values == pytest.approx(values, abs=1e-7)
    some = equations.columns([3, 1])
    assert some.names == (equations.names[3], equations.names[1])
    assert np.array_equal(some.matrix, equations.matrix[..., [3, 1]])


def test_a_payload_is_found_from_two_phases():
    robot = CATALOG["quadrupteron"]
    load = np.array([0.5, 0.004, -0.003, 0.002])
    values = pteron.parameters(robot)
    values[-4:] += load
    heavy = pteron.with_parameters(robot, values)
    model = model_of("quadrupteron", Terms(payload=True))
    first, second = log_of(robot), log_of(heavy)
    log = replace(
        first,
        time=np.r_[first.time, 8.0 + second.time],
        joints=np.vstack([first.joints, second.joints]),
        forces=np.vstack([first.forces, second.forces]),
        payload=np.repeat([0, 1], 2400),
    )
    for derivatives, period in (("central", None), ("periodic", 4.0)):
        wanted = Processing(derivatives=derivatives, period=period)
        treatment = preprocessing_for_log(robot, log, wanted)
        equations = observations_of(model, log, treatment)
        assert ordinary(equations).values[-4:] == pytest.approx(load, abs=1e-7)


def test_the_period_is_taken_from_the_description():
    robot = CATALOG["tripteron"]
    log = log_of(robot, description=Description(period=4.0), joint_noise=1e-7)
    treatment = preprocessing_for_log(robot, log)
    equations = observations_of(model_of("tripteron"), log, treatment)
    assert treatment.derivatives == "periodic"
    assert equations.time[-1] < 4.0
    assert len(equations.time) % 2 == 1

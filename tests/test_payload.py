"""The payload from logs of Pteron's own model, with and without it."""

from dataclasses import replace

import numpy as np
import pytest
from loaded_logs import CENTRAL, EACH, LOAD, NOISE, SOLID, base_of, halves, laden, make_log
from logs_of_motions import log_of, machine
from mechanisms import CLIENTS

import pteron
from pteron.controllers import CONTROLLERS
from pteron.errors import DataError
from pteron.identification.estimators import huber
from pteron.identification.logs import read_log
from pteron.identification.logs.description import Description
from pteron.identification.model import Terms
from pteron.identification.payload import identify_payload
from pteron.identification.signals import Processing
from pteron.motion import pick_and_place, simulate


def expected(payload):
    return np.array((SOLID if "Izz_L" in payload.names else LOAD).values)[: len(payload.names)]


@EACH
def test_it_is_exact_without_noise(name, processing):
    found = identify_payload(
        machine(name), make_log(name), processing=processing, base=base_of(name)
    )
    np.testing.assert_allclose(found.values, expected(found), rtol=1e-9)
    assert found.real
    # All else in the same fit is what the machine was given.
    rank = base_of(name).rank
    np.testing.assert_allclose(
        found.estimate.values[:rank], base_of(name).values(), rtol=1e-6, atol=1e-9
    )
    size = np.sqrt((make_log(name).forces ** 2).mean(axis=0))
    assert (found.residual < 1e-8 * size).all()
    texts = [", ".join(f"{x:.9g}" for x in np.ravel(v)) for v in found.arguments(machine(name))]
    call = "set_payload({{{}}}, {{{}}}, {{{}}},".format(*texts)
    assert found.call(machine(name)).startswith(call)
    # The machine that carries it has what was found on its platform.
    carried = found.add_to(machine(name)).platform.inertia
    own = machine(name).platform.inertia
    more = dict(zip(own.kinds, np.subtract(carried.values, own.values), strict=True))
    felt = [more[kind.removesuffix("_L")] for kind in found.names]
    np.testing.assert_allclose(felt, found.values, rtol=1e-9, atol=1e-12)


def test_a_turning_platform_feels_all_four_values():
    found = identify_payload(
        machine("quadrupteron"), make_log("quadrupteron"), base=base_of("quadrupteron")
    )
    assert found.names == ("m_L", "mgx_L", "mgy_L", "I_L")
    assert (found.mass, *found.first_moment, found.inertia) == tuple(found.values)
    np.testing.assert_allclose(found.center_of_mass, LOAD.center_of_mass, rtol=1e-9)
    assert "Centre of mass" in found.summary()
    assert found.as_dict()["center_of_mass"] == list(found.center_of_mass)


def test_a_platform_that_does_not_turn_feels_the_mass_alone():
    found = identify_payload(machine("tripteron"), make_log("tripteron"), base=base_of("tripteron"))
    assert found.names == ("m_L",)
    assert found.mass == pytest.approx(LOAD.mass, rel=1e-9)
    assert found.first_moment is None
    assert found.inertia is None
    assert found.center_of_mass is None
    assert found.covariance.shape == (1, 1)
    assert "Not felt by the actuators: mgx_L, mgy_L, I_L." in found.summary()


@pytest.mark.parametrize("name", ["tripteron-oblique"])
def test_two_logs_say_what_one_with_both_phases_says(name):
    log = make_log(name, noise=NOISE)
    arguments = {"processing": CENTRAL, "base": base_of(name)}
    both = identify_payload(machine(name), log, **arguments)
    two = identify_payload(machine(name), *halves(log), **arguments)
    # Each of two logs finds its own cut-offs, no more.
    assert (np.abs(two.values - both.values) < 1.5 * both.deviations).all()
    np.testing.assert_allclose(two.deviations, both.deviations, rtol=0.6)


@CLIENTS
@pytest.mark.parametrize("name", ["quadrupteron"])
def test_standard_deviations_cover_the_error(name):
    errors = []
    for draw in range(3):
        log = make_log(name, seed=2, noise=NOISE, draw=draw)
        found = identify_payload(machine(name), log, base=base_of(name))
        errors.append((found.values - expected(found)) / found.deviations)
        assert found.deviations[0] < 0.03 * LOAD.mass
    assert np.abs(errors).max() < 4.0
    assert 0.2 < np.sqrt(np.square(errors).mean()) < 2.0


@CLIENTS
def test_another_estimator_forgives_outliers():
    log = make_log("tripteron", noise=NOISE)
    forces = log.forces.copy()
    forces[::97] += 200.0
    log = replace(log, forces=forces)
    arguments = {
        "processing": Processing(derivatives="central", band=240.0, cutoff=40.0),
        "base": base_of("tripteron"),
    }
    robust = identify_payload(machine("tripteron"), log, estimator=huber, **arguments)
    with pytest.raises(DataError, match="a force stands out"):
        identify_payload(machine("tripteron"), log, **arguments)
    assert robust.estimate.method == "huber"
    assert abs(robust.mass - LOAD.mass) < 4.0 * robust.deviations[0]


@pytest.mark.parametrize("jitter", [0.3, 0.35])
def test_uneven_stamps_are_no_gaps_and_are_named(jitter):
    robot, found = machine("tripteron"), []
    rng = np.random.default_rng(5)
    for heavier in (robot, laden(robot)):
        time = (np.arange(3200) + rng.uniform(-jitter, jitter, 3200)) / 400.0
        plain = log_of(heavier, time=time, force_noise=0.02, joint_noise=1e-6, noise_seed=6)
        found.append(replace(plain, source=f"{len(found)}.csv"))
    payload = identify_payload(robot, *found)
    assert abs(payload.mass - LOAD.mass) < 4.0 * payload.deviations[0] < 0.02
    assert [one.kind for one in payload.findings] == ["jitter", "jitter"]
    assert "time steps differ from the usual" in payload.summary()
    few = [log.part(0, 60) for log in found]
    with pytest.raises(DataError, match=r"noticed before: .* time steps differ"):
        identify_payload(robot, *few)


@CLIENTS
def test_columns_that_are_swapped_are_refused_as_by_identify():
    log = make_log("quadrupteron", noise=NOISE)
    swapped = replace(log, forces=log.forces[:, [1, 0, 2, 3]])
    with pytest.raises(DataError, match="force1 and force2 are swapped"):
        identify_payload(machine("quadrupteron"), swapped, base=base_of("quadrupteron"))


def test_what_the_residuals_show_is_said_with_the_payload():
    log = make_log("tripteron", noise=NOISE)
    late = replace(log.part(4, log.rows), forces=log.forces[: log.rows - 4])
    found = identify_payload(
        machine("tripteron"), replace(late, description=Description()), base=base_of("tripteron")
    )
    assert not found.has_valid_errors
    assert "late for the positions" in found.summary()
    assert found.as_dict()["trial"]["faults"][0]["fault"] == "delay"


@CLIENTS
def test_values_of_no_real_body_are_told():
    # As much taken off one side of the platform as the moment of inertia allows.
    log = make_log("quadrupteron", load=LOAD)
    less = replace(log, payload=1 - log.payload)
    found = identify_payload(machine("quadrupteron"), less, base=base_of("quadrupteron"))
    assert found.mass == pytest.approx(-LOAD.mass, rel=1e-9)
    assert found.is_significant
    assert not found.real
    assert "is what was called with payload the one without it?" in found.summary()


@CLIENTS
@pytest.mark.parametrize("name", ["quadrupteron"])
def test_a_payload_that_was_not_there_is_not_felt(name):
    nothing = pteron.bodies.PlanarInertia(1e-9, (0.0, 0.0), 1e-12)
    log = make_log(name, load=nothing, noise=NOISE)
    found = identify_payload(machine(name), *halves(log), base=base_of(name))
    assert not found.is_significant
    assert "No payload is felt" in found.summary()
    assert identify_payload(
        machine(name), make_log(name, noise=NOISE), base=base_of(name)
    ).is_significant


@CLIENTS
def test_terms_may_be_left_out():
    found = identify_payload(
        machine("tripteron"),
        make_log("tripteron"),
        terms=Terms(offset=False),
        base=base_of("tripteron"),
    )
    assert not any(name.startswith("offset") for name in found.estimate.names)


def without_column(log):
    return (replace(log, payload=None),)


def one_phase(log):
    return (replace(log, payload=np.ones_like(log.payload)),)


def wrong_order(log):
    first, second = halves(log)
    return replace(first, payload=np.ones(first.rows, dtype=int)), second


def in_amperes(log):
    return (replace(log, description=Description(column_force_unit="A")),)


def short_phase(log):
    payload = np.zeros_like(log.payload)
    payload[-20:] = 1
    description = replace(log.description, period=None)
    return (replace(log, payload=payload, description=description),)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without_column, r"log\.csv: no payload column; declare one that is 0 without"),
        (one_phase, "phase 1 only, 0 and 1 are expected; add one without payload"),
        (wrong_order, r"row 1: payload 1 in the log without payload, 0 expected throughout"),
        (in_amperes, r"its forces are in A; declare gains"),
        (short_phase, "no samples with payload are left between the filters' edges"),
    ],
)
def test_logs_that_do_not_show_a_payload_are_refused(change, message):
    logs = change(make_log("tripteron"))
    with pytest.raises(DataError, match=message) as caught:
        identify_payload(machine("tripteron"), *logs, base=base_of("tripteron"))
    assert "\n" not in str(caught.value)


def test_a_log_of_a_simulation_says_when_a_payload_is_carried(tmp_path):
    robot = pteron.load("five-bar")
    cycle = pick_and_place(robot, scale=0.2, duration=0.2, samples=41)
    control = CONTROLLERS["computed_torque"]
    found = simulate(robot, cycle, control, payload=[(0.0, 0.0), (0.1, 0.5)], step=5e-3)
    path = tmp_path / "simulated.csv"
    found.table().write_csv(path)
    log = read_log(path, robot)
    assert log.payload.tolist() == (found.payload > 0.0).astype(int).tolist()
    assert set(log.payload) == {0, 1}
    assert log.payload_mass == 0.5
    table = found.table()
    heavier = table.with_columns(payload=table["payload"].to_numpy() + 0.25)
    heavier.write_csv(path)
    with pytest.raises(DataError, match="or one mass in kg; give each payload its own log"):
        read_log(path, robot)

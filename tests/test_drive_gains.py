"""Drive gains from logs of Pteron's own model, whose forces are told as currents."""

from dataclasses import replace

import numpy as np
import pytest
from loaded_logs import EACH, LOAD, NOISE, PERIOD, SOLID, base_of, halves, laden, make_log
from logs_of_motions import machine
from mechanisms import CLIENTS

import pteron
from pteron.errors import DataError
from pteron.identification.drive_gains import identify_drive_gains
from pteron.identification.logs.description import Description, KnownPayload
from pteron.identification.payload import identify_payload

GAINS = np.array([31.0, -24.0, 40.0, 0.5])
"""N/A; one drive pushes backwards, one is much weaker."""

KNOWN = KnownPayload(LOAD.mass, LOAD.first_moment, LOAD.inertia)
SPATIAL = KnownPayload(SOLID.mass, SOLID.first_moment, SOLID.inertia)


def gains_of(name):
    return GAINS[: len(machine(name).legs)]


def in_currents(log, gains, payload=KNOWN):
    about = replace(log.description, column_force_unit="A", payload=payload)
    return replace(log, forces=log.forces / gains, description=about)


def current_log(name, **options):
    payload = SPATIAL if machine(name).platform.tilts else KNOWN
    return in_currents(make_log(name, **options), gains_of(name), payload)


@EACH
def test_they_are_exact_without_noise(name, processing):
    found = identify_drive_gains(
        machine(name), current_log(name), processing=processing, base=base_of(name)
    )
    np.testing.assert_allclose(found.gains, gains_of(name), rtol=1e-9)
    np.testing.assert_allclose(found.total_least_squares, gains_of(name), rtol=1e-9)
    n, rank = len(gains_of(name)), base_of(name).rank
    np.testing.assert_allclose(
        found.estimate.values[n : n + rank], base_of(name).values(), rtol=1e-6, atol=1e-9
    )
    assert found.gap < 1e-8


@pytest.mark.parametrize("name", ["random 3T 0"])
def test_standard_deviations_cover_the_error(name):
    errors, start, relative = [], [], []
    for draw in range(3):
        log = current_log(name, seed=2, noise=NOISE, draw=draw)
        found = identify_drive_gains(machine(name), log, base=base_of(name))
        error = found.gains - gains_of(name)
        errors.append(error / found.deviations)
        relative.append(error / gains_of(name))
        start.append(found.total_least_squares / gains_of(name) - 1.0)
        assert (found.deviations < 0.03 * np.abs(gains_of(name))).all()
    assert np.abs(errors).max() < 4.0
    assert 0.2 < np.sqrt(np.square(errors).mean()) < 2.0
    # Likelihood makes total least squares better, never much worse.
    assert np.square(relative).mean() < 1.2 * np.square(start).mean()


@CLIENTS
def test_the_gains_make_the_log_one_of_forces():
    log = current_log("quadrupteron")
    robot, base = machine("quadrupteron"), base_of("quadrupteron")
    found = identify_drive_gains(robot, log, base=base)
    about = replace(log.description, gains=tuple(found.gains))
    forces = replace(log, forces=log.forces * found.gains, description=about)
    payload = identify_payload(robot, forces, base=base)
    np.testing.assert_allclose(payload.values, LOAD.values, rtol=1e-8)


def test_two_logs_do_as_well():
    first, second = halves(current_log("tripteron-oblique"))
    first = replace(first, description=replace(first.description, payload=None))
    robot, base = machine("tripteron-oblique"), base_of("tripteron-oblique")
    found = identify_drive_gains(robot, first, second, base=base)
    np.testing.assert_allclose(found.gains, GAINS[:3], rtol=1e-9)


def test_gains_are_wrong_by_what_the_payload_is_wrong_by():
    double = KnownPayload(2.0 * LOAD.mass, tuple(2.0 * np.array(LOAD.first_moment)), 0.0022)
    robot, base = machine("quadrupteron"), base_of("quadrupteron")
    found = identify_drive_gains(robot, current_log("quadrupteron"), payload=double, base=base)
    np.testing.assert_allclose(found.gains, 2.0 * GAINS, rtol=1e-9)


def test_a_3t_platform_needs_the_mass_alone():
    log = in_currents(make_log("tripteron"), GAINS[:3], KnownPayload(LOAD.mass))
    found = identify_drive_gains(machine("tripteron"), log, base=base_of("tripteron"))
    np.testing.assert_allclose(found.gains, GAINS[:3], rtol=1e-9)


def test_what_was_found_can_be_read_and_declared():
    log = current_log("tripteron", noise=NOISE)
    found = identify_drive_gains(machine("tripteron"), log, base=base_of("tripteron"))
    text = found.summary()
    assert "N/A" in text
    assert found.note in text
    declared = tuple(float(value) for value in found.note[len("gains = [") : -1].split(","))
    np.testing.assert_allclose(Description(gains=declared).gains, found.gains, rtol=1e-8)
    assert found.estimate.names[:3] == ("g1", "g2", "g3")
    assert found.estimate.units[:3] == ("N/A",) * 3
    assert not any(name.endswith("_L") for name in found.estimate.names)
    data = found.as_dict()
    assert data["gains"] == found.gains.tolist()
    assert set(data["units"]) == {"N/A"}
    # The currents' noise is what was put on them; it is known from some hundred rows.
    size = np.sqrt((current_log("tripteron").forces ** 2).mean(axis=0))
    np.testing.assert_allclose(found.residual, NOISE[1] * size, rtol=0.2)


def test_a_payload_that_no_actuator_feels_is_refused():
    robot = machine("tripteron")
    # What is "carried" weighs nothing: the log's forces are those of the empty machine.
    empty = make_log("tripteron", load=pteron.bodies.PlanarInertia(1e-30, (0.0, 0.0), 1e-40))
    log = in_currents(empty, GAINS[:3])
    with pytest.raises(DataError, match="the payload does not tell the gains from the inertia"):
        identify_drive_gains(robot, log, base=base_of("tripteron"))


def test_laden_machines_are_what_the_logs_are_made_of():
    robot = machine("quadrupteron")
    change = pteron.parameters(laden(robot)) - pteron.parameters(robot)
    np.testing.assert_allclose(change[-4:], LOAD.values, atol=1e-15)
    assert not change[:-4].any()


def in_newtons(log):
    return (replace(log, description=Description(period=PERIOD, payload=KNOWN)),)


def unknown(log):
    return (replace(log, description=replace(log.description, payload=None)),)


def never_carried(log):
    return (replace(log, payload=np.zeros_like(log.payload)),)


def always_carried(log):
    return (replace(log, payload=np.ones_like(log.payload)),)


def no_column(log):
    return (replace(log, payload=None),)


def two_units(log):
    first, second = halves(log)
    return first, replace(second, description=replace(second.description, column_force_unit="%"))


def mass_alone(log):
    return (replace(log, description=replace(log.description, payload=KnownPayload(0.35))),)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (in_newtons, "forces are in newtons already, motor currents"),
        (unknown, r"the payload is not known, and without it .* declare \[payload\]"),
        (never_carried, "phase 0 only, 0 and 1 are expected; add one where a payload is carried"),
        (always_carried, "phase 1 only, 0 and 1 are expected; add one without payload"),
        (no_column, r"log\.csv: no payload column"),
        (two_units, r"its forces are in %, those of log\.csv in A; give both in one unit"),
        (mass_alone, "only the payload's mass is known, but quadrupteron turns its platform"),
    ],
)
def test_logs_that_do_not_show_gains_are_refused(change, message):
    logs = change(current_log("quadrupteron"))
    with pytest.raises(DataError, match=message) as caught:
        identify_drive_gains(machine("quadrupteron"), *logs, base=base_of("quadrupteron"))
    assert "\n" not in str(caught.value)

"""Transmissions from logs with encoders on both sides, against those of the simulated machine."""

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CLIENTS

import pteron
from pteron.controllers import FeedForwardPD
from pteron.identification import (
    Limits,
    Log,
    Processing,
    identify,
    identify_transmissions,
    random_excitation,
)
from pteron.legs import Drive, Elastic
from pteron.motion import Sensors, simulate

STIFFNESS, DAMPING, PLAY, STEP = 2e4, 40.0, 1e-3, 2e-6


def recorded(drawn, built):
    """Return a log of the joints, with 1 % of noise in the forces, and the motors."""
    series = random_excitation(drawn, limits=Limits(5.0, 60.0), period=3.0, seed=0)
    motion = series.at(np.arange(12000) / 1000.0)
    run = simulate(built, motion, FeedForwardPD(), model=drawn, sensors=Sensors(STEP))
    assert run.stopped is None
    rng, size = np.random.default_rng(0), np.sqrt((run.forces**2).mean(axis=0))
    forces = run.forces + 0.01 * size * rng.normal(size=run.forces.shape)
    joints, motors = (np.round(part / STEP) * STEP for part in (run.joints, run.motors))
    return Log("log", run.time, joints, forces), motors


@CLIENTS
def test_what_bends_is_found_beside_the_bodies_and_goes_into_the_machine(monkeypatch):
    monkeypatch.delenv("PTERON_KERNELS")
    drawn, rotor = pteron.load("delta"), Drive(rotor_inertia=1e-4, ratio=30.0)
    drawn = replace(drawn, legs=tuple(replace(leg, drive=rotor) for leg in drawn.legs))
    soft = replace(rotor, coulomb=1.0, viscous=1.0, elastic=Elastic(STIFFNESS, DAMPING, PLAY))
    built = pteron.with_parameters(drawn, 1.1 * pteron.parameters(drawn))
    built = replace(built, legs=tuple(replace(leg, drive=soft) for leg in built.legs))
    log, motors = recorded(drawn, built)

    found = identify(drawn, log, processing=Processing(delay="auto"))
    assert found.verdict.grade == "trustworthy"
    for machine, share in ((built, 3e-3), (found.machine, 5e-3)):
        bends = identify_transmissions(machine, log, motors)
        np.testing.assert_allclose(bends.stiffness, STIFFNESS, rtol=share)
        assert (bends.stiffness_deviations < 1e-3 * STIFFNESS).all()
        off = np.abs(bends.damping - DAMPING)
        assert (off < 3.0 * bends.damping_deviations + 0.05 * DAMPING).all()
        # The loads of the others hardly ever change their side.
        np.testing.assert_array_equal(np.isnan(bends.backlash), [False, True, True])
        off = np.abs(bends.backlash - PLAY)[:1]
        assert (off < 4.0 * bends.backlash_deviations[:1] + 0.01 * PLAY).all()
    elastic = bends.add_to(found.machine).legs[0].drive.elastic
    assert elastic.stiffness == bends.stiffness[0]
    assert elastic.backlash == bends.backlash[0]
    # Another constant between the encoders, and no play, change nothing else.
    moved = identify_transmissions(built, log, motors + 0.3)
    np.testing.assert_allclose(moved.stiffness, bends.stiffness, rtol=3e-3)


def test_mistakes_are_told():
    time = np.arange(4000) / 1000.0
    joints = 0.1 * np.sin(np.outer(time, [9.0, 11.0, 13.0]))
    log = Log("log", time, joints, np.zeros_like(joints))
    with pytest.raises(pteron.DataError, match=r"motors: shape \(4000, 2\) given, \(4000, 3\) exp"):
        identify_transmissions("tripteron", log, joints[:, :2])
    noise = 1e-5 * np.random.default_rng(0).normal(size=joints.shape)
    with pytest.raises(pteron.DataError, match=r"rho1: its load does not tell how"):
        identify_transmissions("tripteron", log, joints + noise)
    loaded = replace(log, payload=np.ones(len(time), int))
    with pytest.raises(pteron.DataError, match="a payload is carried; take the rows without"):
        identify_transmissions("tripteron", loaded, joints)

"""Batches of machines that differ in masses, friction and payload: each as `simulate` has it."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from mechanisms import CLIENTS, NIGHTLY

import pteron
from pteron.controllers import ComputedTorque
from pteron.equations.drives import Drives, drive_names
from pteron.equations.machine import number_places, numbers
from pteron.equations.variations import variations, varied_numbers, vary_geometry
from pteron.legs import Elastic
from pteron.motion import (
    Machines,
    Sensors,
    advance,
    longest_step,
    machines_about,
    pick_and_place,
    simulate,
    simulate_many,
    with_payload,
)
from pteron.workspace import home_pose

DRIVE = pteron.legs.Drive(coulomb=2.0, viscous=4.0, rotor_inertia=0.05, max_force=80.0)


@pytest.fixture(scope="module")
def robot():
    drawn = pteron.load("quadrupteron")
    return replace(drawn, legs=tuple(replace(leg, drive=DRIVE) for leg in drawn.legs))


def one(machines, k):
    """Return a machine of many by itself."""
    robot = pteron.with_parameters(machines.robot, machines.parameters[k])
    rows = machines.drives[k].reshape(len(Drives._fields), -1)
    legs = tuple(
        replace(leg, drive=replace(DRIVE, coulomb=row.coulomb, viscous=row.viscous,
                                   rotor_inertia=row.inertia))
        for leg, row in zip(robot.legs, (Drives(*column) for column in rows.T), strict=True)
    )  # fmt: skip
    return with_payload(replace(robot, legs=legs), machines.payload[k])


@CLIENTS
def test_each_machine_is_what_simulate_makes_of_it(robot, tmp_path, monkeypatch):
    machines = machines_about(
        robot, 11, masses=0.2, friction=0.5, rotors=0.1, payload=(0.0, 0.5), seed=7
    )
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    given = {"duration": 0.02, "delay": 7e-4}
    many = {"sensors": Sensors(1e-6), **given}
    slow = simulate_many(machines.rows(slice(3)), motion, ComputedTorque(), **many)
    monkeypatch.delenv("PTERON_KERNELS")
    found = simulate_many(machines, motion, ComputedTorque(), out=tmp_path / "runs", **many)
    assert repr(found) == "<Batch of 11 'quadrupteron': 0 ended early>"
    table = pl.read_parquet(tmp_path / "runs" / "*.parquet")
    assert table.columns[:6] == ["machine", "t", "x", "y", "z", "phi"]
    assert len(table) == 11 * 21
    for k in (0, 7, 10):
        alone = simulate(
            one(machines, k), motion, ComputedTorque(), model=robot, sensors=Sensors(1e-6), **given
        )
        samples = table.filter(pl.col("machine") == k)
        for name, values in zip(robot.coordinates, alone.pose.T, strict=True):
            np.testing.assert_allclose(samples[name].to_numpy(), values, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(found.largest[k], np.abs(alone.error).max(axis=0), rtol=1e-9)
        np.testing.assert_allclose(found.force[k], np.abs(alone.forces).max(axis=0), rtol=1e-9)
    for name in ("rms", "largest", "force"):
        np.testing.assert_array_equal(getattr(slow, name), getattr(found, name)[:3])
    threaded = simulate_many(machines, motion, ComputedTorque(), threads=2, **many)
    np.testing.assert_array_equal(threaded.rms, found.rms)
    noisy = {"sensors": Sensors(1e-6, noise=1e-6, seed=1), **given}
    first, part = (
        simulate_many(some, motion, ComputedTorque(), **noisy)
        for some in (machines, machines.rows(slice(4)))
    )
    np.testing.assert_array_equal(first.rms[:4], part.rms)
    with pytest.raises(pteron.DataError, match="give another folder"):
        simulate_many(machines, motion, ComputedTorque(), out=tmp_path / "runs", **many)


def test_machines_of_a_seed_do_not_depend_on_how_many_there_are(robot):
    few, more = (machines_about(robot, n, masses=0.1, friction=0.3, seed=2) for n in (3, 30))
    np.testing.assert_array_equal(few.parameters, more.parameters[:3])
    np.testing.assert_array_equal(few.drives, more.drives[:3])
    factors = more.parameters / pteron.parameters(robot)
    assert 0.9 <= np.nanmin(factors) < 0.93 < 1.07 < np.nanmax(factors) <= 1.1
    assert len({*more.drives[:, 4].tolist()}) == 30  # coulomb of joint 1


@CLIENTS
def test_machines_of_other_geometry_are_what_simulate_makes_of_them(monkeypatch):
    """The controller takes all for the machine as drawn; so each errs by its own tolerances."""
    drawn = pteron.load("delta")
    drawn = replace(drawn, legs=tuple(replace(leg, drive=DRIVE) for leg in drawn.legs))
    changes = variations(drawn)
    amounts = np.random.default_rng(0).uniform(-5e-4, 5e-4, (9, len(changes)))
    built = [vary_geometry(drawn, changes, row) for row in amounts]
    usual = machines_about(drawn, 9)
    machines = replace(usual, geometry=np.array([numbers(one) for one in built]))
    motion = pick_and_place(drawn, home_pose(drawn), least=0.1)
    given = {"sensors": Sensors(1e-6), "duration": 0.02, "delay": 7e-4}
    slow = simulate_many(machines.rows(slice(2)), motion, ComputedTorque(), **given)
    monkeypatch.delenv("PTERON_KERNELS")
    found = simulate_many(machines, motion, ComputedTorque(), **given)
    for name in ("rms", "largest", "force"):
        np.testing.assert_array_equal(getattr(slow, name), getattr(found, name)[:2])
    for k in (0, 8):
        alone = simulate(built[k], motion, ComputedTorque(), model=drawn, limits=False, **given)
        np.testing.assert_allclose(found.largest[k], np.abs(alone.error).max(axis=0), atol=1e-12)
        assert np.abs(alone.error).max() > 1e-5
    still = np.tile(home_pose(drawn), (9, 1)), np.full((9, 3), 0.1), np.zeros((9, 3)), 1e-4, 20
    ahead, *_ = advance(drawn, *still, machines=machines)
    alone, *_ = advance(built[8], *(part[8] for part in still[:3]), 1e-4, 20)
    np.testing.assert_allclose(ahead[8], alone, rtol=0.0, atol=1e-13)
    # Drives that bend begin bent about their own joints.
    soft = replace(DRIVE, elastic=Elastic(2e4, damping=20.0))
    bends = replace(drawn, legs=tuple(replace(leg, drive=soft) for leg in drawn.legs))
    softer = replace(machines_about(bends, 9), geometry=machines.geometry)
    found = simulate_many(softer, motion, ComputedTorque(), duration=0.02)
    assert not found.stopped.any()
    whole = replace(built[8], legs=tuple(replace(leg, drive=soft) for leg in built[8].legs))
    alone = simulate(whole, motion, ComputedTorque(), model=bends, limits=False, duration=0.02)
    np.testing.assert_allclose(found.largest[8], np.abs(alone.error).max(axis=0), atol=2e-6)


def test_tolerances_of_geometry_are_drawn_about_the_drawing(robot):
    given = {"masses": 0.1, "friction": 0.3, "payload": (0.0, 1.0), "seed": 2}
    rigid = machines_about(robot, 3, **given)
    few, more = (machines_about(robot, n, lengths=1e-3, directions=2e-3, **given) for n in (3, 40))
    np.testing.assert_array_equal(few.geometry, more.geometry[:3])
    for name in ("parameters", "drives", "payload"):  # as without tolerances of the geometry
        np.testing.assert_array_equal(getattr(few, name), getattr(rigid, name))
    off = more.geometry - numbers(robot)
    for leg, places in zip(robot.legs, number_places(robot), strict=False):
        for quantity in leg.quantities:
            at = places[quantity.name] + np.arange(len(quantity.value))
            if quantity.role in ("length", "point"):
                assert 9e-4 < np.abs(off[:, at]).max() <= 1e-3 * (1.0 + 1e-12)
            elif quantity.role == "direction":
                np.testing.assert_allclose(np.linalg.norm(more.geometry[:, at], axis=1), 1.0)
                assert 1e-4 < np.abs(off[:, at]).max() < 5e-3
    changes = variations(robot)
    amounts = np.random.default_rng(1).uniform(-1e-3, 1e-3, (2, len(changes)))
    same = [numbers(vary_geometry(robot, changes, row)) for row in amounts]
    np.testing.assert_allclose(varied_numbers(robot, changes, amounts), same, atol=1e-12)


def test_a_machine_that_comes_to_nothing_is_told():
    """One whose links are too short for the motion ends at its first sample, without figures."""
    drawn = pteron.load("delta")
    machines = machines_about(drawn, 2)
    geometry = np.tile(numbers(drawn), (2, 1))
    at = number_places(drawn)[1]["lower_length"]
    geometry[1, at] *= 0.3
    motion = pick_and_place(drawn, home_pose(drawn), least=0.1)
    found = simulate_many(
        replace(machines, geometry=geometry), motion, ComputedTorque(), duration=0.01
    )
    assert found.stopped.tolist()[0] == ""
    assert "reach" in found.stopped[1] or "no forces" in found.stopped[1]
    assert np.isfinite(found.rms[0]).all()
    assert np.isnan(found.force[1]).all() or found.samples[1] < found.samples[0]


@CLIENTS
@pytest.mark.parametrize("elastic", [None, pytest.param(Elastic(2e5), marks=NIGHTLY)])
def test_steps_are_short_enough_for_each_of_many_machines(elastic, monkeypatch):
    """Lighter machines, and those of more friction, ask for shorter steps than the one as drawn."""
    monkeypatch.delenv("PTERON_KERNELS")
    drawn = pteron.load("five-bar")
    drive = pteron.legs.Drive(
        viscous=0.1 if elastic else 300.0, rotor_inertia=1e-3, elastic=elastic
    )
    robot = replace(drawn, legs=tuple(replace(leg, drive=drive) for leg in drawn.legs))
    motion, home = pick_and_place(robot), home_pose(robot)
    many = machines_about(robot, 16, masses=0.9, friction=0.9, rotors=0.9, seed=1)
    steps = [
        longest_step(
            replace(made, legs=tuple(
                replace(leg, drive=replace(drive, viscous=row.viscous, rotor_inertia=row.inertia))
                for leg, row in zip(made.legs, (Drives(*one) for one in numbers.T), strict=True)
            )), home
        )
        for made, numbers in (
            (pteron.with_parameters(robot, own), rows.reshape(len(Drives._fields), -1))
            for own, rows in zip(many.parameters, many.drives, strict=True)
        )
    ]  # fmt: skip
    assert longest_step(robot, home, many) == pytest.approx(min(steps), rel=1e-9)
    assert min(steps) < 0.5 * longest_step(robot, home)
    found = simulate_many(many, motion, ComputedTorque(), model=drawn, duration=0.02)
    assert not found.stopped.any()
    assert found.largest.max() < 5e-3
    if elastic:
        step = 1.5 * min(steps)
        with pytest.raises(pteron.DataError, match="the stiffness of its transmission asks for"):
            simulate_many(many, motion, ComputedTorque(), duration=0.02, step=step)


def test_states_go_on_as_their_machines_do(robot):
    machines = machines_about(robot, 3, masses=0.3, friction=0.5, seed=1)
    pose = np.tile(home_pose(robot), (3, 1))
    velocity = np.full_like(pose, 0.1)
    given = np.zeros_like(pose), 1e-4, 20
    ahead, fast, _, served = advance(robot, pose, velocity, *given, machines=machines)
    assert served.all()
    assert np.ptp(fast, axis=0).min() > 1e-4
    for k in range(3):
        alone, *_ = advance(one(machines, k), pose[k], velocity[k], np.zeros(4), 1e-4, 20)
        np.testing.assert_allclose(ahead[k], alone, rtol=0.0, atol=1e-15)


def test_environments_may_have_a_machine_each(robot):
    environments = pytest.importorskip("pteron.environments")
    machines = machines_about(robot, 2, masses=0.5, seed=1)
    envs = environments.PteronVectorEnv(robot, 2, machines=machines)
    given = {"pose": envs.world.home, "target": envs.world.home}
    envs.reset(seed=0, options=given)
    seen = envs.step(np.zeros((2, 4), np.float32))[0]
    assert (seen[0, :4] != seen[1, :4]).any()
    with pytest.raises(pteron.DataError, match="2 of quadrupteron given, 3 of"):
        environments.PteronVectorEnv(robot, 3, machines=machines)


def test_mistakes_are_told(robot):
    for wrong, message in (
        ({"count": 0}, "count: 0 given"),
        ({"count": 2, "lengths": -1e-3}, "lengths: -0.001 given, 0 or more"),
        ({"count": 2, "directions": np.inf}, "directions: inf given, 0 or more"),
        ({"count": 2, "masses": 1.0}, "masses: 1.0 given, a share"),
        ({"count": 2, "payload": (1.0, 0.5)}, "least and most expected"),
        ({"count": 2, "friction": np.nan}, "friction: nan given"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            machines_about(robot, **wrong)
    many = machines_about(robot, 2)
    with pytest.raises(pteron.DataError, match=r"drives: shape \(2, 3\) given"):
        Machines(robot, many.parameters, np.zeros((2, 3)), many.payload)
    with pytest.raises(pteron.DataError, match=r"geometry: shape \(2, 5\) given"):
        replace(many, geometry=np.zeros((2, 5)))
    for name, column, wrong, message in (
        ("parameters", "m_u1", -1.0, "parameters: machine 1, m_u1: -1 given, 0 or more expected"),
        (
            "parameters",
            "mgx_u1",
            np.nan,
            "parameters: machine 1, mgx_u1: nan given, a finite number",
        ),
        ("drives", "coulomb_1", -2.0, "drives: machine 1, coulomb_1: -2 given, 0 or more expected"),
        ("drives", "offset_1", np.inf, "drives: machine 1, offset_1: inf given, a finite number"),
        ("payload", None, np.nan, "payload: machine 1: nan given, 0 or more expected"),
        ("payload", None, -1.0, "payload: machine 1: -1 given, 0 or more expected"),
    ):
        bad = getattr(many, name).copy()
        names = {"parameters": pteron.parameter_names(robot), "drives": drive_names(robot)}
        bad[(1, names[name].index(column)) if column else 1] = wrong
        with pytest.raises(pteron.DataError, match=message):
            replace(many, **{name: bad})
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    with pytest.raises(pteron.DataError, match="controller"):
        simulate_many(many, motion, "pd")
    with pytest.raises(pteron.DataError, match="delay"):
        simulate_many(many, motion, ComputedTorque(), delay=-1.0)
    with pytest.raises(pteron.DataError, match="machines: 2 of quadrupteron given, 1 of"):
        advance(robot, *np.zeros((3, 4)), 1e-4, 1, machines=many)

"""Calibration of machines with more legs than coordinates, against machines simulated in NumPy."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import done
from mechanisms import CATALOG, CLIENTS, NIGHTLY
from redundant_plant import NOISE, READING_NOISE, measured, off_drawing, places_of
from test_calibration import GEOMETRY, ranks

import pteron
from pteron.calibration import Measurements, calibrate, plan, read_measurements
from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.unknowns import blocks_of
from pteron.errors import DataError

POINT, DELTA = CATALOG["3-rrr-point"], CATALOG["delta-redundant"]
KNOWN = dict.fromkeys(("position", "height", "distance"), NOISE) | {"readings": READING_NOISE}
LEVEL = -0.65
"""Height of a plane within reach of the Delta, m."""


def trial(robot, kind, seed, noise=None, count=60):
    """Return a machine off its drawing, the changes by name, and measurements of it."""
    rng = np.random.default_rng(seed)
    empty = Measurements.from_readings(robot, np.zeros((1, robot.joint_count)))
    blocks = blocks_of(robot, empty, GEOMETRY)
    names = [unknown.name for block in blocks for unknown in block.unknowns]
    cranks, changes = off_drawing(robot, names, rng)
    places = places_of(robot, count, rng, LEVEL if kind == "heights" else None)
    return cranks, changes, measured(robot, cranks, places, kind, rng, noise)


def standard_errors(found, changes):
    """Return the errors of all values, in their standard deviations."""
    return np.array([(v.found - v.drawn - changes[v.name]) / v.deviation for v in found.values])


def errors_elsewhere(robot, cranks, guess):
    """Return the errors (K, m), m, of the poses that a guess of the machine has for readings."""
    places = places_of(robot, 100, np.random.default_rng(99))[:, : robot.freedom]
    joints = guess.joints(cranks.readings(np.pad(places, ((0, 0), (0, 3 - robot.freedom)))))
    return MachineSlopes(robot, ()).poses(guess, joints, places) - places


@pytest.mark.parametrize("noise", [KNOWN, None], ids=["known noise", "unknown noise"])
@pytest.mark.parametrize("robot", [POINT, DELTA], ids=["3-rrr-point", "delta-redundant"])
def test_a_machine_off_its_drawing_is_recovered(robot, noise):
    cranks, changes, given = trial(robot, "poses", 1, noise)
    found = calibrate(robot, given, free=GEOMETRY)
    assert found.verdict.grade == "trustworthy"
    assert (np.abs(standard_errors(found, changes)) < 3.5).all()
    before, after = (
        np.abs(errors_elsewhere(robot, cranks, guess)).max()
        for guess in (found.start, found.fit.guess)
    )
    assert after < 6e-5
    assert before > 50 * after
    expected = found.held_out.expected
    for kind in ("position", "closure"):
        assert 0.6 * expected[kind] < found.held_out.after[kind] < 1.5 * expected[kind]
    # The noise of closures is that of readings.
    assert found.noise["closure"] == pytest.approx(READING_NOISE, rel=0.25)


@NIGHTLY
@pytest.mark.parametrize("kind", ["poses", "heights", "distances", "x alone", "nothing"])
@pytest.mark.parametrize("robot", [POINT, DELTA], ids=["3-rrr-point", "delta-redundant"])
def test_intervals_cover_the_true_values(robot, kind):
    if kind == "heights" and robot is POINT:
        return
    errors = []
    for seed in range(200 if kind == "poses" else 40):
        _, changes, given = trial(robot, kind, seed, KNOWN)
        errors.append(standard_errors(calibrate(robot, given, free=GEOMETRY), changes))
    assert 0.93 < (np.abs(errors) < 1.96).mean() < 0.975


@pytest.mark.parametrize("kind", ["heights", "distances", "x alone", "nothing"])
def test_other_measurements_leave_what_they_do_not_show_at_the_drawing(kind):
    cranks, changes, given = trial(DELTA, kind, 2)
    found = calibrate(DELTA, given, free=GEOMETRY)
    assert (np.abs(standard_errors(found, changes)) < 4.0).all()
    errors = np.abs(errors_elsewhere(DELTA, cranks, found.fit.guess)).max()
    assert errors < 1.5 * max(found.open_errors.values())
    assert found.noise["closure"] == pytest.approx(READING_NOISE, rel=0.25)
    shown = found.observability
    assert shown.rank == shown.at_poses


@pytest.mark.parametrize(
    ("robot", "rank"),
    # Of whole poses, less the motions of the whole machine and its scale.
    [(POINT, 15 - 4), (DELTA, 32 - 7)],
    ids=["3-rrr-point", "delta-redundant"],
)
def test_readings_alone_show_all_but_place_and_scale(robot, rank):
    poses = places_of(robot, 120, np.random.default_rng(0))[:, : robot.freedom]
    given = Measurements.from_readings(robot, pteron.inverse_kinematics(robot, poses))
    assert given.kinds == ["closure"]
    assert ranks(robot, given, poses) == (rank, rank)
    _, _, given = trial(robot, "nothing", 3)
    found = calibrate(robot, given, free=GEOMETRY)
    assert found.verdict.grade == "usable with care"
    assert "closures do not show" in found.verdict.reasons[0]


def test_the_cost_is_that_of_free_poses():
    """With noise in readings and positions, the pose of each row is unknown: it is eliminated."""
    cranks, _, given = trial(POINT, "poses", 4, KNOWN, count=12)
    del cranks
    blocks, start = blocks_of(POINT, given, ["zeros"]), Guess.drawn(POINT, given)
    poses = given.positions[:, :2]
    fitter = Fitter(given, blocks, start, poses)
    fit = fitter.run()
    slopes, guess = MachineSlopes(POINT, ()), fit.guess
    best = 0.0
    for i in range(len(given)):
        pose = fit.poses[i].copy()
        for _ in range(20):
            jacobian = slopes.jacobian(guess, pose[None])[0]
            joints = guess.joints(given.readings[[i]])
            missed = slopes.misfits(guess, joints, pose[None])[0]
            rows = np.vstack([jacobian / READING_NOISE, np.eye(2) / NOISE])
            off = np.r_[missed / READING_NOISE, (poses[i] - pose) / NOISE]
            pose += np.linalg.lstsq(rows, off, rcond=None)[0]
        best += (off**2).sum()
    assert (fit.distances**2).sum() == pytest.approx(best, rel=1e-2)


@pytest.mark.parametrize(
    ("robot", "measure"),
    [(POINT, "positions"), (DELTA, "heights"), pytest.param(DELTA, "distances", marks=CLIENTS)],
)
def test_a_plan_is_within_reach_and_informative(robot, measure):
    places = plan(robot, 12, measure)
    assert places.after < 0.7 * places.before
    np.testing.assert_allclose(
        pteron.inverse_kinematics(robot, places.poses), places.readings, atol=1e-12
    )


def test_a_mistake_in_the_readings_is_named():
    _, _, given = trial(DELTA, "poses", 5)
    swapped = replace(given, readings=given.readings[:, [1, 0, 2, 3]])
    found = calibrate(DELTA, swapped)
    assert found.verdict.grade == "not trustworthy"
    assert found.verdict.reasons[0].startswith("The readings of legs 1 and 2 (theta1 and theta2)")


def test_a_row_off_is_left_out():
    _, _, given = trial(DELTA, "poses", 6)
    readings = given.readings.copy()
    readings[7, 2] += 5e-3  # no other joint confirms it
    found = calibrate(DELTA, replace(given, readings=readings), free=GEOMETRY)
    assert np.flatnonzero(~found.fit.kept).tolist() == [7]
    assert "does not fit: row 8 (off by 2.4 mm or mrad)." in found.verdict.reasons[0]


def test_measurements_of_another_machine_are_refused():
    _, _, given = trial(DELTA, "poses", 7)
    with pytest.raises(DataError, match=r"closures: shape \(60, 0\)"):
        calibrate(DELTA, replace(given, closures=np.empty(0)))


def test_the_command_writes_a_machine_that_fits(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, _, given = trial(DELTA, "poses", 8)
    columns = [*given.readings.T, *given.positions.T]
    names = [*DELTA.joint_names, "x", "y", "z"]
    pl.DataFrame(dict(zip(names, columns, strict=True))).write_csv("log.csv")
    Path("log.toml").write_text(f"[measured]\nnoise = {{ readings = {READING_NOISE} }}\n")
    assert read_measurements(DELTA, "log.csv").setup.noise["closure"] == READING_NOISE
    text = done("calibrate log.csv --robot delta-redundant --out found")
    assert text.startswith("delta-redundant: trustworthy, ")
    data = json.loads(Path("found/calibration.json").read_text("utf-8"))
    assert data["held_out"]["after"]["closure"] < 3 * READING_NOISE
    robot = pteron.load("found/robot.toml")
    joints = np.array([leg.reading.scale if leg.reading else 1.0 for leg in robot.legs])
    joints = joints * given.readings + [
        leg.reading.zero if leg.reading else 0.0 for leg in robot.legs
    ]
    found = pteron.direct_kinematics(robot, joints, tolerance=1e-3)
    tools = found[:, 0] + np.array(robot.platform.tool)
    assert np.abs(tools - given.positions).max() < 1.5e-4
    assert "closure" in Path("found/calibration.html").read_text("utf-8")

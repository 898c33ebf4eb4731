"""Calibration: slopes, ranks, recovery, printers' published values, faults by name, plans."""

import re
from dataclasses import replace

import numpy as np
import pytest
import tilting
from calibrated import GEOMETRY, NOISE, PRINTERS, measured, off_drawing, printer, tool_places
from mechanisms import CLIENTS, NIGHTLY, gated
from scipy.spatial.transform import Rotation

import pteron
from pteron.calibration import Measurements, Place, ReferencePlane, Setup, calibrate, plan
from pteron.calibration.exact_rank import exact_rank
from pteron.calibration.fit import Fitter
from pteron.calibration.guess import Guess, tolerances_of
from pteron.calibration.residuals import MachineSlopes
from pteron.calibration.start import starting_poses
from pteron.calibration.unknowns import blocks_of
from pteron.errors import DataError

COUNTS = {
    "quadrupteron": 18,
    "quadrupteron-oblique": 22,
    "tripteron": 9,
    "tripteron-oblique": 11,
    "five-bar": 10,
    "stewart": 42,
    "delta": 24,
    "linear-delta": 18,
    "orthoglide": 18,
    "par4": 40,
    "3-rrr": 21,
    "hexaglide": 54,
    "hexa": 66,
    "wrist": 21,
    "3-rrr-point": 15,
    "delta-redundant": 32,
}
"""What whole poses in known frames show of the legs."""

TURNING = {"quadrupteron-oblique": 24, "ankle": 24, "wrist": 24, "par4": 42}
"""And with the centre and the axes about which the platform turns."""

GATE = ("quadrupteron-oblique", "delta", "five-bar", "par4", "wrist")


def poses_seen(robot, poses):
    """Return measurements of whole poses without noise."""
    tool = np.array(robot.platform.tool or (0.0, 0.0, 0.0))
    joints = pteron.inverse_kinematics(robot, poses)
    return Measurements.from_readings(
        robot, joints, poses=poses, positions=tool_places(robot, poses, tool)
    )


def of_legs(robot, given):
    """Return the names of the legs' values."""
    blocks = blocks_of(robot, given, GEOMETRY)
    names = [unknown.name for block in blocks for unknown in block.unknowns]
    return [name for name in names if not name.startswith("platform.")]


def ranks(robot, given, poses, free=GEOMETRY):
    """Return the exact rank of what is free, and that of singular values."""
    blocks, start = blocks_of(robot, given, free), Guess.drawn(robot, given)
    rows = MachineSlopes(robot, blocks).rows(start, given, poses, np.arange(len(poses)))
    slopes = rows.slopes.reshape(-1, blocks[-1].where.stop)[rows.measured.reshape(-1)]
    size = np.linalg.norm(slopes, axis=0)
    # A column of rounding alone stays one.
    whole = np.where(size > 1e-9 * size.max(), size, 1.0)
    sizes = np.linalg.svd(slopes / whole, compute_uv=False)
    numerical = int((sizes > 1e-8 * sizes[0]).sum())
    return exact_rank(start, blocks, given, 0)[0], numerical


@pytest.mark.parametrize(
    "name", [name if name in GATE else pytest.param(name, marks=NIGHTLY) for name in COUNTS]
)
def test_whole_poses_show_as_much_as_the_literature_counts(name):
    robot = pteron.load(name)
    poses = pteron.random_poses(robot, 120)
    given = poses_seen(robot, poses)
    assert ranks(robot, given, poses, of_legs(robot, given)) == (COUNTS[name], COUNTS[name])


TURN = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()


@pytest.mark.parametrize("name", ["linear-delta", pytest.param("hexa", marks=NIGHTLY)])
def test_a_turned_machine_shows_as_much(name):
    robot = pteron.turned(pteron.load(name), TURN)
    poses = pteron.random_poses(robot, 120)
    assert ranks(robot, poses_seen(robot, poses), poses) == (COUNTS[name], COUNTS[name])


@pytest.mark.parametrize(
    "name",
    [
        n if n in ("quadrupteron-oblique", "ankle") else pytest.param(n, marks=NIGHTLY)
        for n in TURNING
    ],
)
def test_what_a_platform_turns_about_shows_too(name):
    robot = pteron.turned(pteron.load(name), TURN)
    poses = pteron.random_poses(robot, 120)
    assert ranks(robot, poses_seen(robot, poses), poses) == (TURNING[name], TURNING[name])


def test_a_printers_radius_and_angles_have_an_exact_rank():
    robot = pteron.turned(pteron.load("linear-delta"), TURN)
    poses = pteron.random_poses(robot, 120)
    setup = Setup(planes={"": ReferencePlane(tuple(TURN[:, 2]), known=False)})
    joints = pteron.inverse_kinematics(robot, poses)
    given = Measurements.from_readings(robot, joints, heights=poses @ TURN[:, 2], setup=setup)
    assert ranks(robot, given, poses, ["radius", "angles", "zeros", "lengths"]) == (11, 11)


@CLIENTS
@pytest.mark.parametrize(
    ("name", "equal", "count"),
    [("linear-delta", False, 15), ("delta", True, 20), ("delta", False, 21)],
)
def test_heights_over_an_unknown_plane_show_less(name, equal, count):
    robot = pteron.load(name)
    poses = pteron.random_poses(robot, 300)
    if equal:
        poses[:, 2] = pteron.workspace.home_pose(robot)[2]
        joints = pteron.inverse_kinematics(robot, poses, on_failure="nan")
        poses = poses[np.isfinite(joints).all(axis=1)][:150]
    level = poses[0, 2]
    setup = Setup(planes={"": ReferencePlane(offset=level, known=False)})
    joints = pteron.inverse_kinematics(robot, poses)
    given = Measurements.from_readings(robot, joints, heights=poses[:, 2] - level, setup=setup)
    assert ranks(robot, given, poses) == (count, count)


@pytest.mark.parametrize(
    "robot",
    [
        pteron.load("quadrupteron-oblique"),
        pytest.param(tilting.machine("1T2R", ("PRS", "RRS", "RPS"), 3)[0], marks=NIGHTLY),
        tilting.machine("2R", ("PSS", "RSS"), 3)[0],
        pytest.param(tilting.machine("3T3R", ("UPS", "PSS", "RSS"), 5)[0], marks=NIGHTLY),
        pytest.param(pteron.load("3-rrr"), marks=NIGHTLY),
        pteron.load("delta-redundant"),
        pytest.param(pteron.load("3-rrr-point"), marks=NIGHTLY),
    ],
    ids=lambda robot: robot.platform.motion,
)
@pytest.mark.parametrize("frame_known", gated([True, False], [False]))
def test_slopes_are_those_of_differences(robot, frame_known):
    count, rng = 6, np.random.default_rng(4)
    _, _, poses, readings = off_drawing(robot, 0, count)
    angular = robot.platform.angular
    start = Guess.drawn(robot, Measurements.from_readings(robot, readings))
    slopes = MachineSlopes(robot, ())
    poses = slopes.poses(start, readings, poses)
    if robot.redundancy:  # slopes of least squares are exact where readings agree
        readings = slopes.joints(start, poses)
    setup = Setup(
        marks={"a": Place((0.05, 0.02, 0.03), known=False)},
        planes={"p": ReferencePlane((0.6, 0.0, 0.8), 0.1, known=False)},
        anchors={"w": Place((0.5, 0.4, 0.3), known=False)},
        frame_known=frame_known,
    )
    origins = np.where(np.arange(count) < 3, -1, 1)
    names = ("a",) * count, ("p",) * count, ("w",) * count, ("",) * count
    given = Measurements(
        readings,
        rng.normal(size=(count, 3)),
        poses[:, angular],
        np.full(count, 0.2),
        np.full(count, 0.3),
        origins,
        *names,
        None,
        setup,
        np.zeros((count, robot.redundancy)),
    )
    blocks = blocks_of(robot, given, [*GEOMETRY, "scales"])
    guess = Guess.drawn(robot, given)
    slopes, chosen = MachineSlopes(robot, blocks), np.arange(count)
    rows = slopes.rows(guess, given, poses, chosen)
    step = 1e-6
    for k in range(blocks[-1].where.stop):
        ends = []
        for sign in (step, -step):
            change = np.zeros(blocks[-1].where.stop)
            change[k] = sign
            moved = guess.apply_step(blocks, change)
            there = slopes.poses(moved, moved.joints(readings), poses)
            ends.append(slopes.rows(moved, given, there, chosen).residuals)
        difference = (ends[0] - ends[1]) / (2.0 * step)
        size = 1.0 + np.abs(rows.slopes[..., k]).max()
        assert np.abs(difference - rows.slopes[..., k]).max() < 1e-6 * size


@pytest.mark.parametrize(
    "name",
    gated(["quadrupteron", "stewart", "3-rrr", "par4"], ["stewart"]),
)
def test_a_machine_off_its_drawing_is_found(name):
    robot = pteron.load(name)
    _, steps, poses, readings = off_drawing(robot, 1, 100)
    given = measured(robot, 1, 100).rows(np.arange(100) < 60)
    result = calibrate(robot, given, free=GEOMETRY)
    assert result.verdict.grade == "trustworthy"
    assert result.misfit(steps) < 2.0 * len(steps)
    deviations = np.array([value.deviation for value in result.values])
    assert np.mean(np.abs(result.fit.total - steps) < 1.96 * deviations) > 0.8
    held = np.arange(60, 100)
    before, after = result.errors(poses[held])
    assert np.nanmax(np.abs(before)) > 20.0 * np.nanmax(after)
    # The machine that is written takes readings to where the truth is.
    read = pteron.inverse_kinematics(result.robot, poses[held])
    for i, leg in enumerate(result.robot.legs):
        if leg.reading is not None:
            read[:, i] = (read[:, i] - leg.reading.zero) / leg.reading.scale
    missed = (read - readings[held] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(missed).max() < 3e-4


def steps_of(name, radius, arm, end_stop):
    """Return a printer, and what its stable positions measure."""
    data = PRINTERS[name]
    steps = np.array(data["stable"]) / data["steps_per_mm"] / 1000.0
    robot = printer(radius, arm)
    readings = end_stop + np.sqrt(arm**2 - radius**2) - steps
    heights = np.full(len(steps), data["height_mm"] / 1000.0)
    return robot, Measurements.from_readings(robot, readings, heights=heights)


@pytest.mark.parametrize("name", ["flsun", "large-delta"])
def test_six_free_values_of_a_printer_are_those_that_its_firmware_found(name):
    radius, arm, end_stop = {"flsun": (0.14, 0.28, 0.373), "large-delta": (0.17, 0.34, 0.331)}[name]
    robot, given = steps_of(name, radius, arm, end_stop)
    six = ["radius", "legs[1].angle", "legs[2].angle", "zeros"]
    loose = dict.fromkeys(("radius", "angles", "zeros"), np.inf)
    result = calibrate(robot, given, free=six, prior=loose)
    towers = np.array([leg.guide_point for leg in result.fit.guess.robot.legs])
    radii = 1e3 * np.hypot(towers[:, 0], towers[:, 1])
    angles = np.degrees(np.arctan2(towers[:, 1], towers[:, 0])) % 360.0
    height = np.sqrt(arm**2 - radius**2) - np.sqrt(arm**2 - (1e-3 * radii) ** 2)
    ends = 1e3 * (end_stop + height + result.fit.guess.zeros)
    want = PRINTERS[name].get("saved") or PRINTERS[name]["our_fit"]
    digits = 1e-4 if name == "flsun" else 5e-4  # of the second three digits are told
    assert np.abs(radii - want.get("delta_radius", want.get("radius"))).max() < digits
    assert np.abs(angles - want.get("angle", want.get("angles"))).max() < digits
    assert np.abs(ends - want["position_endstop"]).max() < digits
    rms = 1e3 * np.sqrt(np.mean(result.fit.residuals[:, 3] ** 2))
    assert rms == pytest.approx(PRINTERS[name].get("rms_mm") or want["rms_mm"], abs=5e-5)


def test_seven_heights_leave_rods_at_the_drawing_and_say_so():
    result = calibrate(*steps_of("flsun", 0.14, 0.28, 0.373))
    rods = [value for value in result.values if "lower_length" in value.name]
    assert all(value.origin == "tolerance" for value in rods)
    assert max(abs(value.found - 0.28) for value in rods) < 1e-3
    assert result.observability.at_poses == 7
    assert result.verdict.reasons[0].startswith("x and y may be off by 3.15 mm (95 %): heights do")
    assert "No rows were left for a check" in result.verdict.reasons[1]
    assert "Measure at 54 or more poses" in result.verdict.next_steps[1]


def test_forty_heights_leave_some_for_a_check_where_their_noise_is_given():
    robot = pteron.load("linear-delta")
    truth, _, poses, readings = off_drawing(robot, 1, 40)
    heights = tool_places(truth.robot, poses, truth.marks[""])[:, 2]
    heights += NOISE * np.random.default_rng(1).standard_normal(40)
    for noise, checked in (({"height": NOISE}, True), ({}, False)):
        setup = Setup(noise=noise)
        given = Measurements.from_readings(robot, readings, heights=heights, setup=setup)
        result = calibrate(robot, given, free=GEOMETRY)
        assert (result.held_out is not None) == checked
        assert (result.verdict.grade == "trustworthy") == checked


def test_free_factors_without_tolerance_bend_rods_and_tolerances_hold_them():
    rng = np.random.default_rng(4)
    rings = ((0.0425, 6), (0.085, 9))
    angles = [(r, 2.0 * np.pi * k / count) for r, count in rings for k in range(count)]
    places = [(0.0, 0.0), *((r * np.cos(t), r * np.sin(t)) for r, t in angles)]
    uneven = np.column_stack([places, 1e-4 * rng.standard_normal(16)])
    joints = pteron.inverse_kinematics(printer(0.1442, 0.2881), uneven)
    robot = printer(0.1447, 0.2878)
    given = Measurements.from_readings(
        robot, joints + np.array([3e-4, -2e-4, 1e-4]), heights=np.zeros(16)
    )
    nine = ["zeros", "lengths", "radius", "legs[1].angle", "legs[2].angle"]
    loose = dict.fromkeys(("zeros", "lengths", "radius", "angles"), 10.0)
    trapped, held = (
        calibrate(robot, given, free=free, prior=prior)
        for free, prior in ((nine, loose), (None, None))
    )
    off = [
        max(abs(leg.lower_length - 0.2881) for leg in result.fit.guess.robot.legs)
        for result in (trapped, held)
    ]
    rms = [np.sqrt(np.mean(result.fit.residuals[:, 3] ** 2)) for result in (trapped, held)]
    assert off[0] > 0.018  # m
    assert off[1] < 0.001
    assert rms[0] < rms[1] < 1e-4  # the deviation that falls is no measure of the rods


def faulty(given, kind):
    """Return measurements with a fault."""
    readings, positions = given.readings.copy(), given.positions.copy()
    if kind == "swapped":
        readings[:, [0, 1]] = readings[:, [1, 0]]
    elif kind == "millimetres":
        positions *= 1e3
    elif kind == "turned":
        positions = positions[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
    elif kind == "row":
        positions[17, 0] += 5e-3
    elif kind == "slipped":
        readings[33:, 1] += 1e-3
    elif kind == "backlash":
        readings[:, 0] += 2e-4 * np.sign(np.diff(readings[:, 0], prepend=readings[0, 0]))
    elif kind == "drift":
        readings += np.linspace(0.0, 5e-4, len(readings))[:, None]
    elif kind == "moved":
        positions[33:] += [0.0, 4e-4, 3e-4]
    return replace(given, readings=readings, positions=positions)


@pytest.mark.parametrize("told", gated([True, False], [True]))
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("row", "row 18 (off by"),
        ("slipped", "zero of joint 2 (theta2) slipped by -"),
        ("backlash", "Joint 1 (theta1) stops 0.4"),
        ("drift", "readings drift from the first row to the last"),
        ("moved", "mark tool moved by 0.5"),
    ],
)
def test_a_fault_that_residuals_show_is_named(kind, words, told):
    robot = pteron.load("delta")
    result = calibrate(robot, faulty(measured(robot, 0, 60, told), kind), free=GEOMETRY)
    assert words in result.findings[0].text
    assert result.verdict.grade != "trustworthy"


def test_rows_that_a_fault_explains_are_not_listed_one_by_one():
    robot = pteron.load("stewart")
    given = faulty(measured(robot), "row")
    readings = given.readings.copy()
    readings[-5:, 1] += 1e-3
    result = calibrate(robot, replace(given, readings=readings), free=GEOMETRY)
    assert (~result.fit.kept).sum() == 6
    slipped, left = (finding.text for finding in result.findings)
    assert "zero of joint 2 (rho2) slipped by -0.99" in slipped
    assert "before row 56" in slipped
    assert left.startswith("Left out, as it does not fit: row 18 (off by 5.0")


@CLIENTS
def test_an_instrument_and_a_mark_that_moved_are_told_apart_where_the_platform_turns():
    robot = pteron.load("quadrupteron")
    given, step = measured(robot), np.array([0.0, 4e-4, 3e-4])
    turns = robot.platform.placement(off_drawing(robot)[2])[1][33:]
    for moved, words in ((step, "The instrument moved"), (step @ turns, "The mark tool moved")):
        positions = given.positions.copy()
        positions[33:] += moved
        result = calibrate(robot, replace(given, positions=positions), free=GEOMETRY)
        (finding,) = result.findings
        assert finding.text.startswith(f"{words}")
        assert "before row 34" in finding.text


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("swapped", "readings of legs 1 and 2 (theta1 and theta2) are swapped"),
        ("millimetres", "the positions are in millimetres"),
        ("turned", "its x along y, y along -x, z along z of the base"),
    ],
)
def test_a_mistake_in_the_whole_log_is_named_first_and_undone(kind, words):
    robot = pteron.load("delta")
    result = calibrate(robot, faulty(measured(robot), kind), free=GEOMETRY)
    assert words in result.verdict.reasons[0].lower()
    assert result.verdict.grade == "not trustworthy"
    # What follows is the calibration of the log as it should have been.
    sound = calibrate(robot, measured(robot), free=GEOMETRY)
    np.testing.assert_allclose(result.fit.total, sound.fit.total, rtol=0.0, atol=1e-7)
    sizes = re.findall(r"within (\S+) (mm|m)\b", result.verdict.reasons[0])
    after, before = (float(size) * {"m": 1.0, "mm": 1e-3}[unit] for size, unit in sizes)
    assert after < 0.02 < before


def test_swapped_marks_are_told():
    robot = pteron.load("quadrupteron")
    truth, _, poses, readings = off_drawing(robot)
    marks = {"a": (0.08, 0.0, 0.05), "b": (-0.06, 0.05, 0.02)}
    names = tuple("ab"[i % 2] for i in range(60))
    places = np.array(
        [
            tool_places(truth.robot, poses[i : i + 1], np.array(marks[n]))[0]
            for i, n in enumerate(names)
        ]
    )
    setup = Setup(marks={name: Place(at) for name, at in marks.items()})
    places += NOISE * np.random.default_rng(0).standard_normal(places.shape)
    seen = Measurements.from_readings(robot, readings, poses=poses, positions=places, setup=setup)
    given = replace(seen, marks=names)
    assert calibrate(robot, given, free=GEOMETRY).verdict.grade == "trustworthy"
    other = replace(given, marks=tuple("ba"["ab".index(name)] for name in names))
    assert "marks a and b are swapped" in calibrate(robot, other, free=GEOMETRY).verdict.reasons[0]


def test_swapped_marks_are_told_in_an_unknown_frame_too():
    robot = pteron.load("delta")
    truth, _, poses, readings = off_drawing(robot)
    marks = {"a": (0.08, 0.0, 0.05), "b": (-0.06, 0.05, 0.02)}
    names = tuple("ab"[i % 2] for i in range(60))
    places = [
        tool_places(truth.robot, poses[i : i + 1], np.array(marks[n]))[0]
        for i, n in enumerate(names)
    ]
    seen = Rotation.from_rotvec([0.4, 1.2, -2.0]).apply(places) + np.array([3.0, -1.0, 0.5])
    seen += NOISE * np.random.default_rng(0).standard_normal(seen.shape)
    setup = Setup(marks={name: Place(at) for name, at in marks.items()}, frame_known=False)
    given = Measurements.from_readings(robot, readings, positions=seen, setup=setup)
    right, swapped = (replace(given, marks=tuple(m)) for m in ("ab" * 30, "ba" * 30))
    assert not calibrate(robot, right, free=GEOMETRY).findings
    words = calibrate(robot, swapped, free=GEOMETRY).verdict.reasons[0]
    assert "marks a and b are swapped" in words


@CLIENTS
def test_what_is_measured_at_planned_places_is_trusted():
    """Near phi = 90 degrees, where J is singular, tolerances lead far away."""
    robot = pteron.load("quadrupteron")
    planned = plan(robot, 40, "positions")
    truth, *_ = off_drawing(robot, 5, 20)
    machine = MachineSlopes(robot, ())
    poses = machine.poses(truth, truth.joints(planned.readings), planned.poses)
    places = tool_places(truth.robot, poses, truth.marks[""])
    places += NOISE * np.random.default_rng(1).standard_normal(places.shape)
    given = Measurements.from_readings(robot, planned.readings, positions=places)
    assert calibrate(robot, given).verdict.grade == "trustworthy"


def test_a_mark_far_from_the_tool_leads_to_the_pose():
    robot, at = pteron.load("five-bar"), (0.08, 0.0, 0.0)
    poses = pteron.random_poses(robot, 40)
    given = replace(
        Measurements.from_readings(
            robot,
            pteron.inverse_kinematics(robot, poses),
            positions=tool_places(robot, poses, np.array(at)),
            setup=Setup(marks={"a": Place(at)}),
        ),
        marks=("a",) * 40,
    )
    found = starting_poses(Guess.drawn(robot, given), given)
    np.testing.assert_allclose(found, poses, rtol=0.0, atol=1e-9)


def test_an_unknown_frame_and_distances_find_the_same_machine():
    robot = pteron.load("linear-delta")
    truth, _, poses, readings = off_drawing(robot, 2, 80)
    turn = Rotation.from_rotvec([0.4, 1.2, -2.0])
    places = tool_places(truth.robot, poses, truth.marks[""])
    given = Measurements.from_readings(
        robot,
        readings,
        positions=turn.apply(places) + np.array([3.0, -1.0, 0.5]),
        setup=Setup(noise={"position": 1e-6}, frame_known=False),
    )
    anchor = np.array([0.2, 0.1, -0.4])
    bar = Setup(noise={"distance": 1e-6}, anchors={"": Place((0.19, 0.11, -0.39), known=False)})
    lengths = Measurements.from_readings(robot, readings, setup=bar)
    lengths = replace(lengths, distances=np.linalg.norm(places - anchor, axis=1))
    for seen in (given, lengths):
        result = calibrate(robot, seen, free=GEOMETRY)
        assert result.held_out is not None
        (after,), (before,) = (
            part.values() for part in (result.held_out.after, result.held_out.before)
        )
        assert after < 1e-5 < 1e-4 < before


def test_readings_noise_is_carried_to_what_is_measured():
    robot = pteron.load("five-bar")
    _, steps, poses, readings = off_drawing(robot, 3, 60)
    rng = np.random.default_rng(0)
    noisy = readings + 1e-4 * rng.standard_normal(readings.shape)
    setup = Setup(noise={"position": 1e-6, "readings": 1e-4})
    given = Measurements.from_readings(robot, noisy, poses=poses, setup=setup)
    result = calibrate(robot, given, free=GEOMETRY)
    assert result.fit.kept.all()
    assert np.median(result.fit.distances) < 3.0
    assert result.misfit(steps) < 3.0 * len(steps)


def test_rows_without_a_measurement_or_a_pose_do_not_touch_the_noise():
    robot = pteron.load("five-bar")
    *_, poses, _ = off_drawing(robot, 0, 16)
    given = measured(robot, 0, 16, told=False)
    unmeasured, beyond = given.positions.copy(), given.readings.copy()
    unmeasured[5] = np.nan
    beyond[5] = [np.pi, 0.0]  # its cranks point away from each other
    found = []
    for rows in (replace(given, positions=unmeasured), replace(given, readings=beyond)):
        guess = Guess.drawn(robot, rows)
        fit = Fitter(rows, blocks_of(robot, rows, GEOMETRY), guess, poses).run()
        assert np.isfinite(fit.covariance).all()
        found.append((fit.noise["position"], fit.kept[5], *fit.total))
    assert [kept for _, kept, *_ in found] == [True, False]
    np.testing.assert_allclose(*[[noise, *total] for noise, _, *total in found], rtol=0.01)


@CLIENTS
def test_intervals_hold_where_many_distances_share_a_rows_readings():
    robot, rows, held = pteron.load("linear-delta"), 41, []
    origins = np.where(np.arange(rows) > 0, 0, -1)
    for seed in range(8):
        truth, steps, poses, readings = off_drawing(robot, seed, rows)
        rng = np.random.default_rng(seed)
        places = tool_places(truth.robot, poses, truth.marks[""])
        lengths = np.linalg.norm(places - places[0], axis=1) + 1e-5 * rng.standard_normal(rows)
        setup = Setup(noise={"distance": 1e-5, "readings": 1e-4})
        noisy = readings + 1e-4 * rng.standard_normal(readings.shape)
        given = Measurements.from_readings(robot, noisy, setup=setup)
        lengths[0] = np.nan
        given = replace(given, distances=lengths, origins=origins)
        blocks = blocks_of(robot, given, GEOMETRY)
        found = Fitter(given, blocks, Guess.drawn(robot, given), poses).run()
        units = tolerances_of(blocks)
        variances, axes = np.linalg.eigh(found.covariance / np.outer(units, units))
        seen = variances < 0.05  # of what the distances show
        missed = np.abs(axes.T @ ((found.total - steps) / units)) / np.sqrt(variances)
        held += (missed < 1.96)[seen].tolist()
    assert len(held) > 40
    assert np.mean(held) > 0.85


@pytest.mark.parametrize("measure", ["positions", "heights", "distances"])
def test_planned_poses_tell_more_than_random_ones_of_the_same_box(measure):
    robot = pteron.load("linear-delta")
    chosen = plan(robot, 20, measure, free=GEOMETRY)
    assert chosen.region.holds(chosen.poses).all()
    assert pteron.workspace.prove(robot, chosen.region).holds
    assert chosen.after < chosen.before
    assert tuple(chosen.columns()) == (*robot.coordinates, *robot.joint_names)
    if measure == "positions":
        low, high = chosen.region.box
        random = np.random.default_rng(0).uniform(low, high, (20, 3))
        volumes = []
        for poses in (chosen.poses, random):
            given = poses_seen(robot, poses)
            blocks = blocks_of(robot, given, GEOMETRY)
            setup = Setup(noise={"position": 2e-5})
            fitter = Fitter(replace(given, setup=setup), blocks, Guess.drawn(robot, given), poses)
            volumes.append(np.linalg.slogdet(fitter.run().covariance)[1])
        assert volumes[0] < volumes[1] - 1.0


@pytest.mark.parametrize(
    ("name", "offset", "radius"),
    [("linear-delta", 0.0, 0.087), ("delta", -1.26, 0.43), ("delta-omnid", 0.26, 0.08)],
)
def test_planned_heights_lie_on_the_bed_or_below_home_and_reach_the_rim(name, offset, radius):
    """A printer's z = 0 is its bed; a Delta that hangs from its base, or stands on it, has none."""
    robot = pteron.load(name)
    chosen = plan(robot, 20, "heights")
    assert chosen.plane is not None
    assert chosen.plane.known == (name == "linear-delta")
    assert chosen.plane.offset == pytest.approx(offset, abs=0.01)
    np.testing.assert_allclose(chosen.poses[:, 2], chosen.plane.offset, rtol=0.0, atol=1e-12)
    assert chosen.region.holds(chosen.poses).all()
    assert pteron.workspace.prove(robot, chosen.region).holds
    reached = np.hypot(*chosen.poses[:, :2].T)
    assert reached.max() > 0.98 * radius
    assert (reached > 0.9 * chosen.region.radius).sum() >= 8


def test_wrong_names_and_numbers_are_one_line():
    robot = pteron.load("delta")
    given = measured(robot)
    for given_free, prior, words in (
        (["length"], None, "'length': no group or value of this machine"),
        (None, {"lengths": -1.0}, "lengths = -1: a standard deviation above 0 expected"),
        ([], None, "nothing is free"),
    ):
        with pytest.raises(DataError, match=words):
            calibrate(robot, given, free=given_free, prior=prior)
    with pytest.raises(DataError, match=r"readings: shape \(60, 2\) given"):
        calibrate(robot, replace(given, readings=given.readings[:, :2]))


def test_measurements_from_arrays_and_tables_fit_together():
    robot = pteron.load("delta")
    poses = pteron.random_poses(robot, 6, seed=1)
    read = pteron.inverse_kinematics(robot, poses)
    names = [*robot.joint_names[::-1], "z", "x", "y"]
    table = dict(zip(names, np.hstack([read[:, ::-1], poses[:, [2, 0, 1]]]).T, strict=True))
    named = Measurements.from_readings(robot, table, poses=table)
    np.testing.assert_array_equal(named.readings, read)
    np.testing.assert_array_equal(named.positions, poses)
    np.testing.assert_array_equal(
        Measurements.from_readings(robot, table, positions=table).positions, poses
    )
    for wrong in (
        {"poses": poses[:1]},
        {"poses": poses[:, :2]},
        {"positions": poses[:4]},
        {"heights": poses},
        {"heights": poses[:3, 0]},
    ):
        with pytest.raises(DataError, match=r"shape .* given, .* expected"):
            Measurements.from_readings(robot, read, **wrong)
    with pytest.raises(DataError, match=r"readings: shape \(6, 2\) given, \(\.\.\., 3\) expected"):
        Measurements.from_readings(robot, read[:, :2])

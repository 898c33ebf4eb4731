"""Machines chosen for a job: what they keep, why kinds fall out, files, going on, bad jobs."""

import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import tomlkit
from commands import refused, run
from mechanisms import CLIENTS
from scipy.spatial.transform import Rotation

import pteron
from pteron.design import Job, choose_machine
from pteron.design.choose import evaluators_of
from pteron.design.kind_search import search_kind
from pteron.design.load_margins import margins_of
from pteron.design.machine_space import tool_places
from pteron.design.parts_room import room_between_parts
from pteron.design.proofs import proof_sentence
from pteron.design.rating import Rating
from pteron.design.regions import kind_regions
from pteron.design.workspace_samples import (
    poses_about_tool,
    refine_worst_values,
    sample_poses,
)
from pteron.design.worst_cases import worst_forces
from pteron.dynamics import drive_forces
from pteron.errors import DataError
from pteron.kernels import numeric
from pteron.kinematics import inverse_kinematics, pose_of
from pteron.motion import line_path, polynomial_motion, with_payload
from pteron.report.design.choice import page, write_choice
from pteron.workspace import Box, clearance, pose_margins, prove

JOB = {
    "workspace": {"size": [0.2, 0.2, 0.05]},
    "payload": {"mass": 0.3},
    "cycles": [{"points": [[-0.08, 0.0, 0.0], [0.08, 0.0, 0.0]], "duration": 0.3}],
    "accuracy": {"most": 5e-4},
    "kinds": ["linear-delta"],
    "search": {"evaluations": 40},
}
"""A job that a linear Delta does easily."""


def of(**keys):
    return Job.model_validate(JOB | keys)


@pytest.fixture(scope="module")
def chosen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chosen")
    return choose_machine(of(), folder=folder), folder


def loaded(one):
    """Return the machine of a candidate, from its file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "machine.toml"
        file.write_text(one.robot)
        return pteron.load(file)


def test_a_choice_has_a_summary_a_table_and_shows_in_a_notebook(chosen):
    choice, _ = chosen
    frame = choice.table()
    assert frame["kind"].to_list() == [candidate.kind for candidate in choice.candidates]
    assert frame["price"][0] == choice.best.figures["price"]
    assert choice.summary().splitlines()[0].startswith(f"{choice.best.kind}: ")
    assert f"<b>Kinds of machines</b> {choice.best.kind} is best" in choice._repr_html_()
    nowhere = replace(choice.best, serves=False, why=("no reach",))
    assert nowhere.summary().endswith("infeasible: the nearest design has no reach")


def test_a_chosen_machine_keeps_what_was_asked(chosen):
    one = chosen[0].best
    assert one.serves
    assert "proved" in one.proved
    robot = loaded(one)
    rng = np.random.default_rng(0)
    middle, half = np.array(one.middle), np.array([0.1, 0.1, 0.025])
    poses = middle + rng.uniform(-1.0, 1.0, (2000, 3)) * half
    assert pose_margins(robot, poses).type_i.min() >= 0.1
    assert clearance(robot, poses).least.min() > 0.0
    assert "touch" in one.clear
    low, high = np.array([leg.limits for leg in robot.legs]).T
    joints = inverse_kinematics(robot, poses)
    assert (joints >= low).all()
    assert (joints <= high).all()
    assert prove(robot, Box(tuple(middle - half), tuple(middle + half)), type_i=0.1).holds
    carrying = with_payload(robot, 0.3)
    for shift, turn in zip(rng.uniform(-1.0, 1.0, (5, 3)), rng.uniform(0.0, np.pi, 5), strict=True):
        way = 0.08 * np.array([np.cos(turn), np.sin(turn), 0.0])
        at = middle + shift * (half - np.abs(way))
        motion = polynomial_motion(
            carrying, line_path(carrying, [at - way, at + way]), duration=0.3
        )
        forces = drive_forces(carrying, motion.pose, motion.velocity, motion.acceleration)
        drive = robot.legs[0].drive
        assert np.abs(forces).max() < drive.max_force
        assert np.sqrt((forces**2).mean(axis=0)).max() < drive.rated_force
    assert one.figures["error"] <= 5e-4
    assert min(one.figures[f"{k}_margin"] for k in ("rated", "peak", "speed")) >= 1.0
    assert one.figures["shortest_time"] < 0.3


@CLIENTS
def test_what_is_tried_is_told_first_and_the_page_says_it_well(chosen, tmp_path):
    choice, folder = chosen
    told = []
    again = choose_machine(
        of(search={"evaluations": 12}),
        begun=lambda names, before: told.append((names, before)),
        finished=lambda one: told.append(one.kind),
    )
    assert told == [(("linear-delta",), ()), "linear-delta"]
    assert again.resumed == ()
    file = tmp_path / "job.toml"
    file.write_text(tomlkit.dumps(JOB | {"search": {"evaluations": 12}}))
    first, kind = run(f"choose {file}").stderr.splitlines()
    assert first == (
        "One kind with 12 designs to evaluate, the best of them to be proved: linear-delta"
    )
    assert re.fullmatch(r"1 of 1: linear-delta: (infeasible; )?\d+ of 12 designs meet all .*", kind)
    file.write_text(tomlkit.dumps(JOB))
    found = run(f"choose {file} --out {folder}")
    assert found.stderr == f"Resumed from {folder}: linear-delta finished before\n"
    text = (folder / "choose.html").read_text(encoding="utf-8")
    assert "linear-delta, the one kind of machine that was tried, does what is asked." in text
    assert "linear-delta in the middle of its workspace" in text
    assert "price (as in lists)" in text
    assert not re.search(r"proved: [^<]*not proved", text)
    one = choice.best
    alone = replace(choice, candidates=(replace(one, front=one.front[:1]),))
    assert "What costs what" not in page(alone)


@CLIENTS
def test_a_finished_kind_is_not_searched_again(chosen, tmp_path):
    first, folder = chosen
    again = choose_machine(of(), folder=folder)
    assert again.resumed == ("linear-delta",)
    assert again.as_dict() == first.as_dict()
    other = choose_machine(of(search={"evaluations": 6, "seed": 3}), folder=folder)
    assert other.resumed == ()


TURNING = {
    "workspace": {"size": [0.2, 0.2, 0.05], "turn": [-1.0, 1.0]},
    "payload": {"mass": 0.3, "tool": [0.05, 0.02, -0.1], "inertia": 1e-3},
    "cycles": [{"points": [[-0.05, 0.0, 0.0, -0.5], [0.05, 0.0, 0.0, 0.5]], "duration": 0.4}],
    "kinds": ["delta-4"],
}
"""A job with a tool off P, and a cycle that turns."""


def test_the_tool_stays_in_the_workspace_while_the_platform_turns():
    job = of(**TURNING)
    evaluator = evaluators_of(job)["delta-4"]
    robot, middle = evaluator.kind.machine(evaluator.kind.ranges.mean(axis=0))
    center = tool_places(robot, middle[None])
    away = tool_places(robot, middle + evaluator.poses) - center
    assert np.abs(away).max(axis=0) == pytest.approx([0.1, 0.1, 0.025])
    (cycle,) = evaluator.every_cycle
    pose = cycle.states[0]
    away = tool_places(robot, middle + pose.reshape(-1, 4)) - center
    assert np.abs(away).max(axis=0) == pytest.approx([0.1, 0.1, 0.025])
    assert (pose[..., 3].min(), pose[..., 3].max()) == pytest.approx((-1.0, 1.0))
    (region,) = kind_regions(evaluator, robot, middle)
    assert region.holds(middle + 0.99 * evaluator.poses)[evaluator.poses[:, 3] == 0.0].all()
    # No box that holds a pose of the region is said to miss it.
    poses = np.random.default_rng(0).uniform(*region.box, (2000, 4))
    size = np.array([0.01, 0.01, 0.01, 0.2])
    assert not region.misses(poses - size, poses + size)[region.holds(poses)].any()
    assert region.misses(poses - size, poses + size).any()


def valley():
    """Return a Tripteron whose first leg is nearly stretched where no sample is, and its middle."""
    robot = pteron.load("tripteron")
    points, turned = ([0, 1, 0], [0, 0, 1], [1, 0, 0]), []
    for leg, point in zip(robot.legs, np.array(points, float), strict=True):
        numbers = {"guide_point": 0.29985 * point, "platform_point": 0.05354 * point}
        numbers |= {"upper_length": 0.17786, "lower_length": 0.21418, "limits": None}
        turned.append(replace(leg, **numbers))
    return replace(robot, legs=tuple(turned)), np.array([0.05248, 0.02574, 0.03644])


def test_the_worst_place_is_found_between_the_samples():
    robot, middle = valley()
    job = of(workspace={"size": [0.3, 0.3, 0.15]})

    def margins(poses):
        return 1.0 / worst_forces(robot, middle + poses, 1.0, 10.0)

    sampled = margins(sample_poses(job, robot, 7)).min(axis=0)
    least, where = refine_worst_values(job, robot, margins, 7, keep=2)
    assert least[0] < 0.5 * sampled[0], "the valley is narrower than the samples' distance"
    np.testing.assert_allclose(np.diag(margins(where)), least, rtol=1e-12)
    size = np.array(job.workspace.size)
    drawn = np.random.default_rng(0).uniform(-0.5, 0.5, (20_000, 3)) * size
    assert (least <= 1.01 * margins(drawn).min(axis=0)).all()
    assert (np.abs(where) <= 0.5 * size + 1e-9).all()


@pytest.mark.parametrize(
    "space",
    [
        {"radius": 0.12, "height": 0.1},
        {"size": [0.2, 0.2, 0.1], "turn": [-0.4, 0.6]},
        {"poses": [[-0.1, 0.0, 0.0], [0.1, 0.05, 0.02]]},
    ],
)
def test_worse_places_stay_in_the_workspace(space):
    robot = replace(pteron.load("quadrupteron"), name="with a tool")
    robot = replace(robot, platform=replace(robot.platform, tool=(0.03, 0.01, -0.05)))
    job, seen = of(workspace=space), []

    def values(poses):
        seen.append(poses)
        turned = np.cos(3.0 * poses[:, 3] - 1.0)
        return np.column_stack([turned, -poses @ [1.0, 1.0, 0.2, 0.0], -np.abs(poses[:, 2])])

    least, where = refine_worst_values(job, robot, values, keep=2)
    poses = np.vstack(seen)
    places = tool_places(robot, poses) - tool_places(robot, np.zeros((1, 4)))
    if "radius" in space:
        assert np.hypot(places[:, 0], places[:, 1]).max() <= 0.12 + 1e-9
        assert np.abs(places[:, 2]).max() <= 0.05 + 1e-9
    elif "size" in space:
        assert (np.abs(places) <= np.array([0.1, 0.1, 0.05]) + 1e-9).all()
        assert poses[:, 3].min() >= -0.4 - 1e-9
        assert poses[:, 3].max() <= 0.6 + 1e-9
        assert least[0] == pytest.approx(np.cos(3.0 * -0.4 - 1.0), abs=1e-12)
    else:
        assert len(poses) == len(sample_poses(job, robot)), "a list has no poses between"
    assert (least <= values(poses).min(axis=0)).all()
    assert len(where) == 3


def test_a_cycle_between_the_poses_of_a_list_keeps_the_limits():
    space = {"poses": [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]]}
    ends = np.array([[-0.15, 0.1, -0.05], [0.15, -0.1, 0.05]])
    cycle = {"points": ends.tolist(), "duration": 0.5, "anywhere": False}
    (evaluator,) = evaluators_of(of(workspace=space, cycles=[cycle], accuracy=None)).values()
    kept = next(one for one in search_kind(evaluator, 20, 0) if not one.misses)
    low, high = np.array([leg.limits for leg in kept.robot.legs]).T
    line = ends[0] + np.linspace(0.0, 1.0, 41)[:, None] * (ends[1] - ends[0])
    joints = inverse_kinematics(kept.robot, kept.middle + line)
    assert (joints >= low).all()
    assert (joints <= high).all()
    assert "so are the cycles between them" in proof_sentence(evaluator, [])


def test_margins_are_those_between_the_directions_of_a_cycle_too(chosen):
    # In a cylinder a line is farthest out beside its middle, where no corner of a box is.
    one = chosen[0].best
    (evaluator,) = evaluators_of(of(workspace={"radius": 0.1, "height": 0.05})).values()
    carrying = with_payload(loaded(one), 0.3)
    most = np.array([leg.drive.max_force for leg in carrying.legs])
    found = margins_of(evaluator, carrying, np.array(one.middle), None)
    turns, tau = np.radians(np.arange(0.0, 360.0, 3.0)), np.linspace(0.0, 1.0, 61)
    ways = np.c_[np.cos(turns), np.sin(turns), 0.0 * turns]
    across = np.c_[-np.sin(turns), np.cos(turns), 0.0 * turns]
    places = [0.06 * across + [0.0, 0.0, z] for z in (-0.025, 0.025)]
    places = np.array(places).reshape(-1, 1, 3)
    line = 0.16 * np.tile(ways, (2, 1))[:, None]
    # A quintic from rest to rest in 0.3 s.
    share = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2) - 0.5
    rate = 30.0 * tau**2 * (1.0 - tau) ** 2 / 0.3
    gain = 60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau) / 0.3**2
    at = np.array(one.middle) + places + line * share[:, None]
    forces = drive_forces(carrying, at, line * rate[:, None], line * gain[:, None])
    assert found.figures["peak_margin"] <= 1.003 * (most / np.abs(forces)).min()


def test_rounded_corners_of_a_cycle_are_seen_in_time():
    up, across = 0.01, 0.08
    points = [[-across, 0, -up], [-across, 0, up], [across, 0, up], [across, 0, -up]]
    cycle = {"points": points, "corner": 0.015, "duration": 0.4}
    (evaluator,) = evaluators_of(of(cycles=[cycle])).values()
    (places,) = evaluator.every_cycle
    fine = replace(places.select_places(np.array([0])), samples=5001).states[2]
    seen = places.both_ways().states[2]
    assert np.linalg.norm(seen, axis=-1).max() > 0.98 * np.linalg.norm(fine, axis=-1).max()


def test_guides_tools_and_thin_posts_count_as_room():
    tool = {"mass": 0.3, "tool": [0.0, 0.0, -0.2]}
    evaluator = evaluators_of(of(payload=tool, cell={"margin": 0.0}))["linear-delta"]
    robot, middle = evaluator.kind.machine(evaluator.kind.ranges.mean(axis=0))
    legs = tuple(replace(leg, limits=(-3.0, 3.0)) for leg in robot.legs)
    robot = replace(robot, legs=legs)
    sizes, _ = evaluator.machine_space.judge_extents(
        evaluator.machine_space.extents(robot, middle[None], middle)[0]
    )
    assert sizes["height"] == pytest.approx(6.0), "guides reach from end to end"

    def lacks(low, high):
        box = {"low": list(low), "high": list(high)}
        job = of(payload=tool, keep_out=[box], cell={"margin": 0.0})
        space = evaluators_of(job)["linear-delta"].machine_space
        return "keep-out" in space.judge_extents(space.extents(robot, middle[None], middle)[0])[1]

    # A box of 2 mm about a point of a rod, of a guide, and of what leads to the tool.
    center = tool_places(robot, middle[None])[0]
    chain = np.asarray(numeric(robot, "joint_points")(middle[None])[0])[0, 0]
    ends = chain[[2, 3]]
    guide = np.array(robot.legs[1].guide_point) - 2.5 * np.array(robot.legs[1].joint_axis)
    for point in (ends.T @ [0.63, 0.37], guide, center + np.array([0.0, 0.0, 0.11])):
        assert lacks(point - center - 1e-3, point - center + 1e-3)
        assert not lacks(point - center + 0.03, point - center + 0.032)


@pytest.mark.parametrize("name", ["stewart", "hexapteron", "pentapteron", "5-rpur"])
def test_tilts_fill_a_cone(name):
    job = of(workspace={**JOB["workspace"], "tilt": 0.2}, kinds=[name])
    evaluator = evaluators_of(job)[name]
    axes = pteron.rotation_of(evaluator.kind.robot, evaluator.poses)[..., 2]
    tilts = np.arccos(np.clip(axes[:, 2], -1.0, 1.0))
    assert set(np.round(tilts, 9)) == {0.0, 0.2}
    assert len(np.unique(np.round(axes, 9), axis=0)) == 7


def tilted(evaluator, count):
    """Return random poses of a machine that leans to every side, from the middle."""
    job, rng = evaluator.job, np.random.default_rng(0)
    lean = job.workspace.tilt * np.sqrt(rng.random(count)).clip(0.5)
    way = rng.uniform(0.0, 2.0 * np.pi, count)
    vectors = lean[:, None] * np.c_[-np.sin(way), np.cos(way), 0.0 * way]
    matrices = Rotation.from_rotvec(vectors).as_matrix()
    poses = np.asarray(pose_of(evaluator.kind.robot, np.zeros(3), matrices))
    half = 0.5 * np.array(job.workspace.size)
    at = poses_about_tool(evaluator.kind.robot, poses[:, 3:])
    at[:, :3] += rng.uniform(-1.0, 1.0, (count, 3)).round(1) * half
    return at


@CLIENTS
def test_worse_tilts_are_looked_for_in_the_whole_cone():
    tool = {"payload": {"mass": 1.0, "tool": [0.0, 0.0, 0.1]}}
    job = of(workspace={"size": [0.2, 0.2, 0.1], "tilt": 0.3}, kinds=["stewart"], **tool)
    evaluator = evaluators_of(job)["stewart"]
    robot, middle = evaluator.kind.machine(evaluator.kind.ranges.mean(axis=0))

    def lengths(poses):
        rams = inverse_kinematics(robot, middle + poses)
        return np.hstack([rams, -rams])

    drawn = lengths(tilted(evaluator, 5000)).min(axis=0)
    assert (drawn < lengths(evaluator.poses).min(axis=0) - 6e-4).any(), (
        "samples miss the worst tilts"
    )
    least, where = evaluator.worst(robot, lengths)
    assert (least <= drawn + 3e-4).all()
    leans = np.arccos(pteron.rotation_of("stewart", where)[:, 2, 2])
    assert leans.max() <= 0.3 + 1e-9


@CLIENTS
def test_rams_go_as_far_as_the_job_asks():
    space = {"size": [0.2, 0.2, 0.1], "tilt": 0.2}
    (evaluator,) = evaluators_of(of(workspace=space, kinds=["stewart"])).values()
    kept = [one for one in search_kind(evaluator, 120, 0) if not one.misses]
    assert kept
    robot, middle = kept[-1].robot, kept[-1].middle
    low, high = np.array([leg.limits for leg in robot.legs]).T
    joints = inverse_kinematics(
        robot, middle + np.vstack([evaluator.poses, tilted(evaluator, 2000)])
    )
    assert (joints > low).all()
    assert (joints < high).all()
    assert (high <= 1.7 * low).all()
    # The tubes are as long as the shortest ram.
    own = robot.legs[0].bodies["u"].values[0]
    assert own == pytest.approx(robot.legs[1].bodies["u"].values[0] * low[0] / low[1], rel=1e-9)


def test_drives_and_joints_have_room_on_base_and_platform():
    (evaluator,) = evaluators_of(of(kinds=["delta"])).values()
    one = next(r for r in search_kind(evaluator, 60, 0) if not r.misses)
    parts = one.options, one.joints, one.parts
    distance, _, box = room_between_parts(one.machine, *parts, 0.04)
    assert distance > 0.0
    width, length = one.options[0].outline
    ends = [
        np.array(leg.guide_point) + side * length * np.array(leg.direction)
        for leg in one.machine.legs
        for side in (0.0, 1.0, -1.0)
    ]
    inside = [bool((box[0] <= end).all() and (end <= box[1]).all()) for end in ends]
    assert all(inside[::3])
    assert sum(inside) >= 6  # all motors on one side
    assert one.figures["height"] >= width
    assert one.figures["footprint"] >= np.prod(np.ptp(box, axis=0)[:2])
    near = [
        replace(leg, guide_point=(0.05 * leg.guide_point[0], 0.05 * leg.guide_point[1], 0.0))
        for leg in one.machine.legs
    ]
    close, where, _ = room_between_parts(replace(one.machine, legs=tuple(near)), *parts, 0.04)
    assert close < 0.0
    assert where == "on the base"
    wide, where, _ = room_between_parts(one.machine, *parts, 1.0)
    assert wide < 0.0
    assert where == "on the platform"


def test_shares_make_a_duty_cycle():
    fast = JOB["cycles"][0]
    loads = []
    for share in (None, 1.0):
        slow = fast | {"duration": 0.6, "dwell": 1.0}
        cycles = [fast, slow] if share is None else [fast | {"share": 1}, slow | {"share": 3}]
        evaluator = evaluators_of(of(cycles=cycles))["linear-delta"]
        values = evaluator.kind.ranges.mean(axis=0)
        values[0] += 0.7  # twice the size
        robot, middle = evaluator.kind.machine(values)
        rating = Rating(values, middle=middle, worst=np.zeros((0, 3)))
        found, _ = evaluator.loads(evaluator.add_payload(robot), rating, None)
        loads.append(found.margins(evaluator.options["slider"].numbers(0.5), [0, 1, 2]))
    times = np.array([0.3, 3 * 1.6])
    parts = [1.0 / margins[0] ** 2 for margins in loads]
    bearing = loads[0][0] > 0.0  # of others the gear bears less than the motor's friction
    assert (loads[1][0] > loads[0][0])[bearing].all()
    assert bearing.sum() > 100
    assert (parts[1] >= parts[0] * times[0] / times.sum() * (1 - 1e-9))[bearing].all()
    assert loads[1][1:] == pytest.approx(loads[0][1:])


def test_why_a_kind_falls_out_is_told():
    (one,) = choose_machine(of(cell={"height": 0.12}, search={"evaluations": 12})).candidates
    assert not one.serves
    assert any("height" in text and "at most 0.12 m asked" in text for text in one.why)


def test_kinds_are_those_that_can_do_the_motion():
    turning = of(workspace={**JOB["workspace"], "turn": [-1, 1]}, kinds=["five-bar", "delta"])
    with pytest.raises(DataError, match="five-bar moves along x y only") as caught:
        choose_machine(turning)
    assert "delta does not turn" in str(caught.value)
    five = of(workspace={**JOB["workspace"], "turn": [-1, 1]}, kinds=["pentapteron", "par4"])
    with pytest.raises(DataError, match="pentapteron does not turn, but"):
        choose_machine(five)
    tilting = of(workspace={**JOB["workspace"], "tilt": 0.1}, kinds=["par4", "5-rpur"])
    with pytest.raises(DataError, match="par4 does not tilt, but"):
        choose_machine(tilting)


def test_a_cycle_that_tilts_suits_two_rotation_axes():
    space = {"size": [0.08, 0.08, 0.04], "tilt": 0.2}
    points = [[-0.03, 0.0, 0.0, 0.1, 0.05, 0.0], [0.03, 0.0, 0.0, -0.1, 0.05, 0.0]]
    cycles = [{"points": points, "duration": 0.5, "anywhere": False}]
    job = of(workspace=space, cycles=cycles, kinds=["pentapteron", "hexapteron"])
    ends = []
    for evaluator in evaluators_of(job).values():
        (cycle,) = evaluator.cycles
        poses = cycle.states[0][0]
        ends.append(pteron.rotation_of(evaluator.kind.robot, poses[[0, -1]])[..., 2])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


@CLIENTS
@pytest.mark.parametrize(
    ("name", "space"),
    [
        ("3-rrr-point", {"size": [0.2, 0.2]}),
        ("3-upu", {"size": [0.2, 0.2, 0.1]}),
        ("delta-redundant", {"size": [0.2, 0.2, 0.1]}),
        ("hexapteron", {"size": [0.08, 0.08, 0.04], "tilt": 0.1}),
        ("pentapteron", {"size": [0.06, 0.06, 0.03], "tilt": 0.1}),
    ],
)
def test_machines_of_five_freedoms_and_redundant_ones_are_chosen_and_proved(name, space):
    motion, search = {"speed": 0.2, "acceleration": 2.0}, {"evaluations": 150}
    keys = {"workspace": space, "motion": motion, "cycles": [], "accuracy": None}
    choice = choose_machine(of(kinds=[name], search=search, **keys))
    (best,) = choice.candidates
    assert best.serves
    assert "energy per cycle (J)" not in best.figure_texts  # there is no cycle
    (place,) = re.findall(r"P is at \(([^)]*)\) mm", page(choice))
    assert len(place.split(",")) == len(space["size"])
    robot = loaded(best)
    assert robot.platform.motion == pteron.load(name).platform.motion
    assert all(leg.drive is not None for leg in robot.legs)
    poses = np.array(best.middle) + evaluators_of(of(kinds=[name], **keys))[name].poses
    margins = pose_margins(robot, poses)
    assert margins.least.min() > 0.0
    if name == "3-upu":
        assert np.abs(pteron.kinematics.constraint_measure(robot, poses)).min() > 0.05


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"workspace": {"size": [300.0, 300.0, 150.0]}}, "are these mm"),
        ({"workspace": {"size": [0.1, 0.1, 0.1], "radius": 0.2}}, "a box has size"),
        ({"objectives": ["beauty"]}, "is none of price"),
        ({"cycles": []}, "nothing says what the motors must do"),
        ({"objectives": ["cycle_time"]}, "every cycle has its duration"),
        ({"cycles": [{"points": [[0, 0], [1, 0]], "duration": 1.0}]}, "points of 2 numbers given"),
        ({"payload": {"mass": -1.0}}, "mass"),
        ({"nonsense": 1}, "nonsense"),
        ({"links": {"upper": ["wood"]}}, "is no stock"),
        ({"cell": {"low": [0, 0, 0], "high": [1, 1, 1]}}, "need [workspace] center"),
        ({"motors": "motors.csv"}, "a table expected: [motors] with list"),
        ({"cell": {"footprint": [0.1, 1]}}, "a footprint of 100 x 1000 mm has no room"),
        (
            {"cell": {"height": 0.04}},
            "a height of 40 mm has no room for the workspace with 30 mm about it, 110 mm",
        ),
        (
            {
                "workspace": {"size": [0.2, 0.2, 0.05], "center": [0, 0, 0.5]},
                "cell": {"low": [-1, -1, 0], "high": [0.05, 1, 1]},
            },
            "along x it goes from -1 to 0.05 m, and the workspace with 30 mm about it from -0.13",
        ),
        ({"keep_out": [{"low": [0.09, -1, -1], "high": [1, 1, 1]}]}, "it is in the workspace"),
        ({"keep_out": [{"low": [90, -1, -1], "high": [100, 1, 1]}]}, "are these mm?"),
        ({"accuracy": {"most": 0.1}}, "is this mm?"),
        ({"cycles": [{"points": [[-80, 0, 0], [80, 0, 0]]}]}, "are these mm?"),
        ({"workspace": {"size": [0.2, 0.2], "tilt": 20.0}}, "is this in degrees?"),
        (
            {"cycles": [{"points": [[0, 0, 0], [0.15, 0, 0]], "duration": 1.0, "anywhere": False}]},
            "where it is (anywhere = false)",
        ),
        ({"workspace": {"size": [0.2, -0.1, 0.1]}}, "workspace.size, item 2: -0.1 given"),
        ({"workspace": {"size": [0.2]}}, "at least 2 of them"),
        ({"workspace": {"size": [0.2, 0.2], "turn": [-90, 90]}}, "are these degrees?"),
        ({"payload": {"mass": 1.0, "tool": [0, 0, -100]}}, "are these mm?"),
        ({"payload": {"mass": 1.0, "inertia": -1.0}}, "payload: inertia"),
        ({"kinds": ["delta", "delta"]}, "given twice"),
        ({"workspace": {"poses": [[0.0, 0.0, 0.0]]}}, "what works at one pose is a fixture"),
        ({"payload": {"mass": 5000.0}}, "5000 kg given: is this in grams?"),
        ({"payload": {"mass": 1.0, "center": [0, 0, -60]}}, "are these mm?"),
        ({"motion": {"speed": 1000.0}}, "is this in mm/s?"),
        ({"motion": {"acceleration": 1e4}}, "is this in mm/s^2?"),
        ({"cycles": [JOB["cycles"][0] | {"duration": 400.0}]}, "400 s given for 160 mm: is this"),
        ({"cycles": [JOB["cycles"][0] | {"duration": 0.0004}]}, "0.0004 s given for 160 mm, 400"),
        ({"cycles": [JOB["cycles"][0] | {"dwell": 500.0}]}, "dwell: 500 s given: is this in ms?"),
        ({"most": {"price": 100}}, "the cheapest drives of linear-delta alone cost 810"),
        (
            {"kinds": ["par4"], "workspace": {"size": [0.2, 0.2, 0.1], "turn": [-1, 1]}},
            "par4 turns",
        ),
        ({"limits": {"stress": 2.0}}, "limits.stress"),
        ({"limits": {"inertia": [10.0, 0.1]}}, "[least, greatest] above 0 expected"),
        ({"limits": {"buckling": 0.5}}, "limits.buckling"),
        ({"process": {"force": 0.0}}, "process.force"),
        ({"links": {"lower": ["steel-rod:2"]}}, "at least 4 and 0.5 mm expected"),
        ({"keep_out": [{"low": [0.11, -1, -1], "high": [1, 1, 1]}]}, "with 30 mm about it"),
        ({"cycles": [TURNING["cycles"][0]]}, "[workspace] turn is not given; at least [-0.5, 0.5]"),
        ({"cycles": [*TURNING["cycles"], JOB["cycles"][0] | {"share": 2}]}, "share given of some"),
    ],
)
def test_a_bad_job_is_refused_in_a_line(keys, line, tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(tomlkit.dumps(JOB | keys))
    assert line in refused(f"choose {file}")


def test_a_cycle_that_does_not_fit_and_motors_without_inertia_are_refused(tmp_path):
    with pytest.raises(DataError, match="600 x 0 x 0 mm does not fit"):
        choose_machine(of(cycles=[{"points": [[-0.3, 0, 0], [0.3, 0, 0]], "duration": 1.0}]))
    motors = tmp_path / "motors.csv"
    motors.write_text("name,rated_torque,peak_torque,max_speed\na,1,3,300\n")
    with pytest.raises(DataError, match="rotor_inertia"):
        choose_machine(of(motors={"list": str(motors)}))
    motors.write_text("name,rotor_inertia,rated_torque,peak_torque,max_speed\na,1e-4,1,3,300\n")
    with pytest.raises(DataError, match="price: asked for"):
        choose_machine(of(motors={"list": str(motors)}))


def test_a_keep_out_box_beside_a_cylinders_corner_is_not_in_it():
    space, box = {"radius": 0.1, "height": 0.1}, {"high": [1.0, 1.0, 1.0]}
    of(workspace=space, keep_out=[box | {"low": [0.105, 0.105, -1.0]}])
    with pytest.raises(ValueError, match="it is in the workspace"):
        of(workspace=space, keep_out=[box | {"low": [0.095, 0.095, -1.0]}])


def test_motors_in_a_toml_file_have_prices(tmp_path):
    file = tmp_path / "motors.toml"
    text = 'name = "a"\nrotor_inertia = 1e-5\nrated_torque = 1\npeak_torque = 3\nmax_speed = 300\n'
    file.write_text(f"[[motors]]\n{text}price = 70\n")
    options = evaluators_of(of(motors={"list": str(file)}))["linear-delta"].options["slider"]
    assert {one.price - one.gearbox.price for one in options.all} == {70.0}
    file.write_text(f"[[motors]]\n{text}price = -1\n")
    with pytest.raises(DataError, match="motor a: price: -1 given"):
        evaluators_of(of(motors={"list": str(file)}))


def test_a_machine_that_no_longer_serves_leaves_the_folder(chosen, tmp_path):
    choice, _ = chosen
    write_choice(choice, tmp_path)
    (fallen,) = (replace(one, serves=False, why=("it is too dear",)) for one in choice.candidates)
    other = replace(choice, candidates=(fallen,))
    write_choice(other, tmp_path)
    assert not (tmp_path / "linear-delta.toml").exists()
    write_choice(choice, tmp_path)
    (tmp_path / "linear-delta.toml").write_text("# mine now\n")
    write_choice(other, tmp_path)
    assert (tmp_path / "linear-delta.toml").exists(), "a file that was changed stays"


def test_gearboxes_and_prices_that_cannot_be(tmp_path):
    gears = tmp_path / "gears.csv"
    gears.write_text("name,joint,ratio,inertia,backlash,stiffness,price\na,rad,1,0,0,1e4,1\n")
    with pytest.raises(DataError, match='no gearbox with joint = "slider", as linear-delta needs'):
        choose_machine(of(motors={"gearboxes": str(gears)}))
    gears.write_text("name,joint,ratio,inertia,backlash,stiffness,price\na,m,1,0,0,1e4,-1\n")
    with pytest.raises(DataError, match="price: -1 given, 0 or more expected"):
        choose_machine(of(motors={"gearboxes": str(gears)}))


@CLIENTS
def test_ctrl_c_keeps_what_is_finished(tmp_path):
    file, out = tmp_path / "job.toml", tmp_path / "out"
    file.write_text(tomlkit.dumps(JOB | {"kinds": ["linear-delta", "hexa"]}))
    given = [sys.executable, "-m", "pteron", "choose", str(file), "--out", str(out)]
    process = subprocess.Popen([*given, "--workers", "2"], stderr=subprocess.PIPE, text=True)
    while not (out / "kinds" / "linear-delta.json").exists() and process.poll() is None:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"Finished kinds are kept in {out}" in told
    assert "Traceback" not in told
    assert (out / "kinds" / "linear-delta.json").exists()
    assert not (out / "choose.json").exists()
    assert not list(out.rglob("*.tmp"))


@CLIENTS
def test_workers_end_with_the_process_that_asked(tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(tomlkit.dumps(JOB | {"kinds": ["linear-delta", "hexa"]}))
    given = [sys.executable, "-m", "pteron", "choose", str(file), "--workers", "2"]
    process = subprocess.Popen(given, stderr=subprocess.DEVNULL)

    def told(*given):
        return subprocess.run(["ps", "-ww", *given], capture_output=True, text=True).stdout

    workers = []
    while not workers:
        assert process.poll() is None
        time.sleep(0.1)
        lines = told("-o", "pid=,args=", "--ppid", str(process.pid)).splitlines()
        workers = [line.split()[0] for line in lines if "spawn_main" in line]
    process.kill()
    process.wait()
    for _ in range(600):
        if not told("-o", "pid=", "-p", ",".join(workers)):
            break
        time.sleep(0.1)
    assert not told("-o", "pid=", "-p", ",".join(workers))


@CLIENTS
def test_the_command_writes_a_page_and_files_that_other_commands_take(tmp_path):
    file, out = tmp_path / "job.toml", tmp_path / "out"
    file.write_text(tomlkit.dumps(JOB | {"kinds": ["linear-delta", "delta"]}))
    found = run(f"choose {file} --out {out}")
    assert found.exit_code == 0
    assert found.stderr.startswith("2 kinds with 40 designs each to evaluate, ")
    assert "linear-delta" in found.stdout
    assert "linear-delta" in (out / "choose.html").read_text()
    data = json.loads((out / "choose.json").read_text())
    for one in data["kinds"]:
        if one["serves"]:
            assert run(f"check {out / one['kind']}.toml").exit_code == 0
    again = run(f"choose {file} --out {out} --json")
    assert "finished before" in again.stderr
    assert json.loads(again.stdout)["kinds"] == data["kinds"]

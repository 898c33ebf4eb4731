"""Workspaces of a search: ranges of orientations, places for the objective; equal designs."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from mechanisms import CLIENTS

from pteron.design import Design, ReportedDesign, Spec, Task, prove_design, search
from pteron.design.evolution import distinct_front, lexicographic_best
from pteron.design.rows import evaluate_design
from pteron.errors import DataError
from pteron.indices import evaluate
from pteron.kinematics import rotation_of
from pteron.workspace import conditions
from pteron.workspace.conditions import keeps
from pteron.workspace.fit import Fit
from pteron.workspace.tilts import OrientedRegion


def factor(moves, low, high):
    return {"moves": moves, "by": "factor", "range": (low, high)}


LINKS = [factor("legs.upper_length", 0.8, 1.3), factor("legs.lower_length", 0.8, 1.3)]
RAMS = [factor("legs.platform_point", 0.8, 1.2), factor("legs.guide_point", 0.8, 1.2)]
BOTH = {"alpha": (-0.1, 0.1), "beta": (-0.1, 0.1)}
RANGES = {
    "sprint-z3": (RAMS, {"low": (0.5,), "high": (0.6,), "tilt": 0.3}),
    "stewart": (RAMS, {"center": (0.0, 0.0, 2.0), "edge": 0.1, "tilt": 0.2}),
    "ball-table": (LINKS, {"low": (0.11,), "high": (0.13,), "tilt": 0.2}),
    "wrist": (RAMS, {"tilt": 0.3, "angles": {"yaw": (-0.2, 0.3)}}),
    "pentapteron": (LINKS, {"center": (0.0, 0.0, 0.0), "edge": 0.04, "angles": BOTH}),
}


def task_of(robot, **given):
    variables, workspace = RANGES.get(robot, (LINKS, None))
    usual = {"variables": variables, "workspace": workspace}
    usual["objectives"] = [{"minimise": "condition"}]
    return Task.from_spec(Spec.model_validate({"robot": robot} | usual | given))


def poses_in(task, count, seed=0):
    """Return poses drawn from a workspace's box of places, and its tilts and angles."""
    robot, table, rng = task.robot, task.spec.workspace, np.random.default_rng(seed)
    low, high = (np.array(end) for end in table.ends)
    poses = np.zeros((count, robot.freedom))
    poses[:, : len(low)] = low + rng.random((count, len(low))) * (high - low)
    for name, ends in (table.angles or {}).items():
        poses[:, robot.coordinates.index(name)] = rng.uniform(*ends, count)
    if table.tilt is not None:
        at = len(low)
        poses[:, at : at + 2] = rng.uniform(-table.tilt, table.tilt, (count, 2))
        leans = np.arccos(rotation_of(robot, poses)[:, 2, 2])
        poses = poses[leans <= table.tilt]
    return poses


@pytest.mark.parametrize("name", RANGES)
def test_all_orientations_of_ranges_are_proved_and_rated(name):
    task = task_of(name)
    proved = prove_design(Design(task, task.robot))
    assert [proof.holds for proof in proved.workspace] == [True]
    assert isinstance(proved.workspace[0].region, OrientedRegion)
    poses = poses_in(task, 20_000)
    assert len(poses) > 10_000
    assert proved.workspace[0].region.holds(poses).all()
    assert keeps(task.robot, conditions(task.robot, type_i=0.05, type_ii=0.01), poses).all()
    worst = evaluate(task.robot, "condition", poses).max()
    assert 0.93 * proved.design.quantity("condition") < worst
    assert worst < 1.001 * proved.design.quantity("condition")


def test_a_region_of_tilts_is_a_cone():
    task = task_of("stewart")
    design = Design(task, task.robot)
    region = design.region(task.stated_poses[0])
    pose = np.array([0.0, 0.0, 2.0, 0.19, 0.19, 0.0])
    assert not region.holds(pose)
    assert region.misses(pose[None], pose[None])[0]
    assert region.holds(pose * [1, 1, 1, 0.5, 0.5, 1])
    assert not region.misses(design.poses, design.poses).any()
    middle = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    assert region.holds(middle + (1.0 - 1e-9) * (design.poses - middle)).all()


def test_a_tilt_that_is_not_reached_is_missed_with_its_pose():
    """The rams of a hexapod end: at some tilt between the level pose and the greatest."""
    wide = RANGES["stewart"][1] | {"tilt": 0.9}
    task = task_of("stewart", workspace=wide)
    assert evaluate_design(task, task.start)["misses workspace"] > 0.0
    proof = prove_design(Design(task, task.robot)).workspace[-1]
    assert proof.holds is False
    assert proof.region.holds(proof.counterexample)
    floors = conditions(task.robot, type_i=0.05, type_ii=0.01)
    assert not keeps(task.robot, floors, proof.counterexample[None]).all()


@CLIENTS
def test_a_report_says_where_only_samples_of_orientations_are_proved():
    """Near singularities too many boxes of five coordinates stay undecided."""
    workspace = {"center": (0.0, 0.0, 0.0), "edge": 0.05, "angles": BOTH}
    floors = {"type_i": 0.05, "type_ii": 0.06}
    task = task_of("pentapteron", workspace=workspace, floors=floors)
    design = Design(task, task.robot)
    lines = ReportedDesign(**vars(prove_design(design)), name="start").proofs
    assert lines[0].startswith("workspace, at 9 sampled orientations of its ranges alone, proved")


def test_faults_of_ranges_are_stated():
    faults = {
        "delta": ({"edge": 0.1, "tilt": 0.1}, "delta does not tilt to every side"),
        "pentapteron": ({"edge": 0.1, "tilt": 0.1}, "give the ranges of its angles"),
        "quadrupteron": ({"edge": 0.1, "angles": {"psi": (0, 1)}}, "psi given, but the .* are phi"),
        "stewart": ({"edge": 0.1, "tilt": 0.1, "angles": {"roll": (0, 1)}}, "range of roll or pit"),
        "wrist": (None, "workspace: missing; wrist only turns"),
    }
    for name, (workspace, pattern) in faults.items():
        with pytest.raises(DataError, match=pattern):
            task_of(
                name, variables=RAMS if name in ("wrist", "stewart") else LINKS, workspace=workspace
            )
    with pytest.raises(DataError, match="cube: about places, but wrist only turns"):
        task_of("wrist", objectives=[{"maximise": "cube"}])
    with pytest.raises(ValueError, match="are these degrees"):
        task_of("wrist", workspace={"angles": {"yaw": (-30.0, 30.0)}})
    with pytest.raises(DataError, match="leave its tilt out of pose"):
        task_of("sprint-z3", pose=(0.55, 0.1, 0.0))


def test_values_that_differ_by_less_than_the_tolerance_are_equal():
    costs = np.array([[1.2, -0.8335], [1.2 + 3e-15, -0.84235], [1.6, -0.84296], [1.1, -0.5]])
    assert distinct_front(costs).tolist() == [3, 1]
    assert lexicographic_best(costs[:3], [0, 1]) == 1
    assert lexicographic_best(costs[:3], [1, 0]) == 1
    # A dense front stays: no chain of small steps removes it.
    dense = np.linspace(1.0, 2.0, 2001)
    dense = np.column_stack([dense, 5.0 - 2.0 * dense])
    kept = dense[distinct_front(dense)]
    assert kept[:, 0].min() < 1.001 * 1.001
    assert kept[:, 1].min() == 1.0
    for row in dense:
        assert (kept <= row + 1.001e-3 * np.abs(row)).all(axis=1).any()


@CLIENTS
def test_no_design_of_a_front_is_bettered_at_an_equal_value():
    """Without a tolerance a machine 3e-15 m shorter stood beside one better in all else."""
    spec = Spec.model_validate(
        {
            "robot": "sprint-z3",
            "pose": (0.55, 0.0, 0.0),
            "variables": [
                {"name": "rod", "moves": "legs.lower_length", "range": (0.4, 0.9)},
                {"name": "plate"} | factor("legs.platform_point", 0.7, 1.3),
            ],
            "workspace": {"low": (0.5,), "high": (0.6,)},
            "objectives": [{"minimise": "links"}, {"maximise": "type_ii"}],
            "search": {"population": 8, "generations": 3, "refined": 1, "seed": 1},
        }
    )
    front = search(spec)
    costs = front.task.costs(front.designs)
    for k, row in enumerate(costs):
        gains = (costs - row) / np.abs(row)
        gains[k] = 1.0
        assert not ((gains <= 1e-3).all(axis=1) & (gains.sum(axis=1) <= 0.0)).any()


PLACED = {
    "five-bar": (31, {"sides": (0.08, 0.05)}, {"minimise": "condition"}),
    "delta": (9, {"sides": (0.3, 0.3, 0.1)}, {"minimise": "condition"}),
    "sprint-z3": (101, {"sides": (0.1,), "tilt": 0.2}, {"maximise": "type_ii"}),
    "ball-table": (101, {"sides": (0.02,), "tilt": 0.1}, {"minimise": "condition"}),
    "tripteron": (9, {"sides": (0.06, 0.06, 0.06)}, {"minimise": "force"}),
}


@CLIENTS
@pytest.mark.parametrize("name", PLACED)
def test_no_place_of_a_fine_grid_betters_that_of_the_workspace(name):
    count, workspace, objective = PLACED[name]
    variables = RAMS if name == "sprint-z3" else LINKS
    task = task_of(name, workspace=workspace, objectives=[objective], variables=variables)
    design = prove_design(Design(task, task.robot)).design
    (target,) = task.spec.objectives
    best = target.sign * design.quantity(target.quantity)
    center, side = design.cube.center, design.cube.side
    low, high = (
        center - 1.5 * np.array(workspace["sides"]),
        center + 1.5 * np.array(workspace["sides"]),
    )
    floors = conditions(task.robot, type_i=0.05, type_ii=0.01)
    for at in product(*np.linspace(low, high, count).T):
        placed = replace(design, known=Fit(np.array(at), task.shape[1], side, 0.0))
        if keeps(task.robot, floors, placed.poses).all() and placed.side == side:
            assert best <= target.sign * placed.quantity(target.quantity) + 0.01 * abs(best)


def test_a_workspace_that_floats_is_where_the_objective_is_best():
    """The place where margins are largest has a condition number that is 25 % worse."""
    task = task_of("five-bar", workspace={"sides": (0.08, 0.05)})
    design = Design(task, task.machine([1.0, 1.3]))
    margin = replace(design, known=design._largest_cube).quantity("condition")
    assert prove_design(design).design.quantity("condition") < 0.8 * margin
    required = {"quantity": "condition", "most": 0.9 * margin}
    bound = task_of(
        "five-bar",
        workspace={"sides": (0.08, 0.05)},
        objectives=[{"minimise": "links"}],
        requirements=[required],
    )
    assert evaluate_design(bound, [1.0, 1.3])["misses 1 condition"] == 0.0

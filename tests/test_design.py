"""Searches for a design: what they ask, what they find, what is proved of it, and going on."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import tomlkit
from commands import done, refused, run
from mechanisms import CATALOG, CLIENTS
from objectives import crank_area, ends_its_process, widest_pose
from threadpoolctl import threadpool_limits

import pteron
from pteron.design import (
    Change,
    Design,
    DesignQuantity,
    FrontReport,
    Spec,
    Task,
    cube_proofs,
    prove_design,
    proved_cube,
    read_spec,
    search,
    start_design,
    survey,
)
from pteron.design.cycle_loads import best_motors, shortest_time
from pteron.design.paths import named_numbers
from pteron.design.rows import evaluate_design
from pteron.design.variables import geometry_slopes
from pteron.equations.machine import numbers
from pteron.errors import DataError, ModelError, OutputError
from pteron.indices import Elasticity, Tolerances, evaluate, pose_error, stiffness
from pteron.manipulator.machine_record import expect_machine
from pteron.manipulator.stretched_links import stretch_link
from pteron.motion import Motor, choose, pick_and_place, size, with_payload
from pteron.workspace import Box, conditions, largest_cube, prove
from pteron.workspace.conditions import keeps

LENGTHS = [
    {"moves": "legs.upper_length", "range": (0.1, 0.35), "each": True},
    {"moves": "legs.lower_length", "range": (0.1, 0.35), "each": True},
    {
        "name": "guides",
        "moves": ("-legs[2].guide_point.x", "legs[4].guide_point.x"),
        "range": (0.15, 0.4),
    },
]


def spec_of(**given):
    usual = {
        "robot": "quadrupteron",
        "variables": LENGTHS,
        "objectives": [{"maximise": "cube"}, {"minimise": "links"}],
        "requirements": [{"quantity": "links", "most": 1.39}, {"quantity": "stroke", "most": 1.0}],
        "search": {"population": 4, "generations": 2, "refined": 2},
    }
    return Spec.model_validate(usual | given)


@pytest.fixture(scope="module")
def task():
    return Task.from_spec(spec_of())


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A small search, and the folder of what it has evaluated."""
    folder = tmp_path_factory.mktemp("search") / "generations"
    return search(spec_of(), folder=folder), folder


def test_a_path_names_numbers_of_the_file():
    robot = pteron.load("quadrupteron")
    assert [p.path for p in named_numbers(robot, "legs.upper_length")][3] == "legs[4].upper_length"
    (one,) = named_numbers(robot, "-legs[2].guide_point.x")
    assert (one.sign, one.part, one.read(robot)) == (-1, 0, -0.26)
    assert len(named_numbers(robot, "legs[1,3].platform_point")) == 6


def functions_spec():
    reach = DesignQuantity("m", "largest coordinate", widest_pose, name="widest_pose")
    spec = spec_of(objectives=[{"minimise": "links"}], requirements=[])
    spec = spec.with_objectives(minimise=[crank_area], maximise=["cube", reach])
    return spec.with_requirement(crank_area, most=0.6)


def test_functions_of_a_user_are_objectives_and_requirements(tmp_path):
    front = search(functions_spec(), folder=tmp_path)
    assert [o.quantity for o in front.task.spec.objectives] == ["crank_area", "cube", "widest_pose"]
    for k in range(len(front)):
        assert front.objectives[k, 0] == crank_area(front.robot(k)) <= 0.6
    assert (front.objectives[:, 2] > 0.0).all()
    page = FrontReport(front).page()
    assert "crank_area as small as possible" in page
    assert "crank_area at most 0.6" in page
    # The folder is of these functions: it is gone on with them, and refused with others.
    assert search(functions_spec(), folder=tmp_path).designs.equals(front.designs)
    other = eval("lambda robot: 2.0 * len(robot.legs)")
    other.__name__ = "crank_area"
    spec = spec_of(objectives=[{"minimise": "links"}]).with_objectives(minimise=[other])
    with pytest.raises(OutputError, match="holds results of another plan"):
        search(spec, folder=tmp_path)
    words = (
        r"^other processes cannot take part: .*define functions and classes at the top of a module"
    )
    with pytest.raises(pteron.PteronError, match=words):
        search(spec, workers=2)


@CLIENTS
def test_a_process_that_is_ended_is_named():
    spec = spec_of(objectives=[{"minimise": "links"}]).with_objectives(minimise=[ends_its_process])
    with pytest.raises(
        pteron.PteronError, match=r"^a process that did a part of the work was ended"
    ):
        search(spec, workers=2)


def test_a_front_has_a_summary_a_table_and_shows_in_a_notebook(found):
    front, _ = found
    assert front.summary().startswith("quadrupteron: ")
    assert front.table().columns == list(front.headings.values())
    assert front.as_dict()["front"] == front.designs.select(list(front.headings)).to_dicts()
    html = front._repr_html_()
    assert "<b>quadrupteron</b>" in html
    assert "designs evaluated" in html
    with pytest.warns(DeprecationWarning, match=r"^Front\.table is a method .* write \.designs"):
        assert front.table["links"].equals(front.designs["links"])
    with pytest.warns(DeprecationWarning, match=r"^Front\.table is a method"):
        assert front.table.height == len(front)


@CLIENTS
def test_functions_of_a_user_cross_to_other_processes():
    front, shared = search(functions_spec()), search(functions_spec(), workers=2)
    assert shared.designs.equals(front.designs)


def test_a_function_that_gives_no_number_says_why():
    def none_at_all(robot):
        raise ModelError("nothing to measure")

    spec = spec_of(objectives=[{"minimise": "links"}]).with_objectives(minimise=[none_at_all])
    design = Design(Task.from_spec(spec), pteron.load("quadrupteron"))
    assert np.isnan(design.quantity("none_at_all"))
    assert design.missing_reason("none_at_all") == "nothing to measure"
    with pytest.raises(DataError, match=r"^links: is a quantity already"):
        spec.with_objectives(minimise=[DesignQuantity("m", "", len, name="links")])
    with pytest.raises(DataError, match=r"^name: '' given to a quantity, an identifier expected"):
        spec.with_requirement(DesignQuantity("m", "", len), most=1.0)
    with pytest.raises(DataError, match=r'^"?.kube.? is no quantity'):
        spec.with_objectives(maximise=["kube"])
    with pytest.raises(DataError, match=r"^none_at_all: neither least nor most given"):
        spec.with_requirement(none_at_all)


def test_a_package_brings_quantities_to_files_and_processes(tmp_path):
    (tmp_path / "own_quantities.py").write_text(
        'def leg_count(robot):\n    """Number of legs."""\n    return len(robot.legs)\n'
    )
    info = tmp_path / "own_quantities-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-quantities\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pteron.design]\nleg_count=own_quantities:leg_count\n")
    code = (
        "import pteron.design as d; s = d.Spec.model_validate({'robot': 'delta', 'variables': "
        "[{'moves': 'legs.upper_length', 'range': (0.1, 0.2)}], 'objectives': [{'minimise': "
        "'leg_count'}]}); t = d.Task.from_spec(s); "
        "print(d.Design(t, t.robot).quantity('leg_count')); "
        "print(d.quantities()['leg_count'].about)"
    )
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split("\n")[:2] == ["3.0", "Number of legs."]


@pytest.mark.parametrize("name", [*CATALOG, "ball-table", "stewart"])
def test_every_machine_has_variables_and_keeps_its_start(name):
    robot = pteron.load(name)
    tables = [
        {"moves": "legs.platform_point", "by": "factor", "range": (0.9, 1.1)},
        {"moves": "legs.guide_point.x", "by": "offset", "range": (-0.1, 0.1)},
    ]
    one = Task.from_spec(spec_of(robot=name, variables=tables, requirements=[]))
    assert one.machine([1.0, 0.0]) == robot
    other = one.machine([1.05, 0.02])
    np.testing.assert_allclose(other.legs[0].guide_point[0], robot.legs[0].guide_point[0] + 0.02)
    change = geometry_slopes(robot, one.variables, [1.0, 0.0]) @ [0.05, 0.02]
    np.testing.assert_allclose(numbers(other), numbers(robot) + change, atol=1e-9)


def test_a_stretched_link_is_that_of_a_longer_bar():
    """A bar of one section, its axis off the link's: mass per length, distance and width kept."""

    def bar(length, density=1.3, off=0.02):
        mass = density * length
        inertia = mass * (length**2 / 3.0 + off**2)
        return pteron.bodies.PlanarInertia.of_body(mass, (length / 2.0, off), inertia)

    np.testing.assert_allclose(stretch_link(bar(0.2), 1.7).values, bar(0.34).values)


def test_slopes_of_the_conditions_are_those_of_differences(task):
    geometry = start_design(task).geometry
    poses = pteron.random_poses("quadrupteron", 3, type_i=0.2)
    _, by_pose, by_geometry = task.conditions.slopes(geometry, poses, 1.0, by_geometry=True)
    way, step = np.random.default_rng(0).normal(size=len(geometry)), 1e-6
    ends = [task.conditions.rows(geometry + s * step * way, poses, 1.0) for s in (1.0, -1.0)]
    np.testing.assert_allclose(by_geometry @ way, (ends[0] - ends[1]) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(by_pose, task.conditions.slopes(geometry, poses, 1.0)[1])
    moved = poses + step * np.array([0.3, -0.5, 0.7, 0.2])
    change = task.conditions.rows(geometry, moved, 1.0) - task.conditions.rows(geometry, poses, 1.0)
    np.testing.assert_allclose(by_pose @ (moved - poses)[0], change, atol=1e-10)


def test_quantities_are_those_of_the_public_functions(task):
    values = task.ranges.mean(axis=0)
    design = Design(task, task.machine(values.tolist()))
    robot, poses = design.robot, design.poses
    assert design.quantity("condition") == pytest.approx(evaluate(robot, "condition", poses).max())
    assert design.quantity("kappa") == pytest.approx(evaluate(robot, "kappa", poses).max())
    corners = design.cube.center + design.cube.edge * (np.array([[0, 0, 0], [1, 1, 1]]) - 0.5)
    corners = np.column_stack([corners, [0.0, 0.0]])
    forces = pteron.drive_forces(robot, corners, [0, 1.0, 0, 0], [-10.0, 0, 0, 0])
    assert design.quantity("force") >= np.abs(forces).max() * (1 - 1e-9)
    masses = [p for p in pteron.manipulator.parameter_data(robot) if p.kind == "m"]
    total = sum(
        v
        for p, v in zip(
            pteron.manipulator.parameter_data(robot), pteron.parameters(robot), strict=True
        )
        if p in masses
    )
    assert design.quantity("moving_mass") == pytest.approx(total)


@CLIENTS
@pytest.mark.parametrize("name", ["five-bar"])
def test_the_cube_is_that_of_the_proved_search(name):
    """Another search, by linear programs over another lattice, finds none that is larger."""
    robot = pteron.load(name)
    lengths = [{"moves": "legs.upper_length", "by": "factor", "range": (0.9, 1.1)}]
    floors = {"type_i": 0.0, "type_ii": 0.0}
    asked = spec_of(robot=name, variables=lengths, floors=floors, requirements=[])
    cube = start_design(Task.from_spec(asked)).cube
    known = largest_cube(robot, np.zeros(robot.freedom), proved=False)
    assert cube.edge == pytest.approx(known.edge, rel=0.005)


@CLIENTS
def test_a_tube_between_the_points_is_no_part_of_the_cube():
    """The Tripteron's links are equally long: they fold, unreachable, onto a line through it."""
    asked = spec_of(robot="tripteron", variables=LENGTHS[:1], requirements=[])
    design = start_design(Task.from_spec(asked))
    cube = proved_cube(design)
    assert cube is not None
    assert cube.edge > 0.99 * design.cube.edge
    rng = np.random.default_rng(0)
    poses = cube.center + cube.edge * rng.uniform(-0.5, 0.5, (20_000, 3))
    floors = conditions(design.robot, type_i=0.05, type_ii=0.01)
    assert keeps(design.robot, floors, poses).all()


def test_a_tube_is_seen_beside_many_points_on_a_limit(task):
    """Where legs 1, 3 and 4 are at their floor along whole edges of the cube, and leg 2 has a tube:
    more of the lattice's points are lower than those next to it.
    """
    legs = [0.1421513466196257, 0.14091138740676068, 0.20621511249695, 0.14091138740676074]
    legs += [0.2709107028147659, 0.14134247537318864, 0.20621511249720534, 0.1413424753731848]
    design = Design(task, task.machine([*legs, 0.15859749082937893]))
    assert proved_cube(design).edge > 0.99 * design.cube.edge


@CLIENTS
def test_what_the_points_miss_goes_back_to_the_search():
    """A tube, as wide as the links differ, through which no point and no step of a search goes."""
    asked = {"floors": {"type_i": 0.0, "type_ii": 0.0}, "requirements": []}
    task = Task.from_spec(spec_of(robot="tripteron", variables=LENGTHS[:2], **asked))
    design = Design(task, task.machine([0.25] * 3 + [0.2501] * 3))
    (first,) = cube_proofs(design, design.cube.center, 0.9999 * design.cube.edge)
    assert first.counterexample is not None
    assert 0.9 * design.cube.edge < proved_cube(design).edge < 0.9999 * design.cube.edge


@pytest.mark.parametrize("threads", [1, 2])
def test_every_design_of_a_front_is_proved(found, threads):
    """Also in a process whose linear algebra adds up in another order than the search's."""
    front, _ = found
    for k, edge in enumerate(front.designs["cube"]):
        with threadpool_limits(threads):
            told = prove_design(Design(front.task, front.robot(k)))
        assert told.cube.edge == edge == told.design.cube.edge
        ends = (told.cube.center + side * edge for side in (-0.5, 0.5))
        box = Box(*((*end.tolist(), 0.0) for end in ends))
        assert prove(front.robot(k), box, type_i=0.05, type_ii=0.01).holds


def test_a_workspace_that_fails_between_its_points_is_missed():
    """The line onto which equal links of a Tripteron's first leg cannot fold, within a box."""
    box = {"low": (-0.03, 0.2, -0.03), "high": (0.04, 0.26, 0.04), "samples": 2}
    task = Task.from_spec(workspace_spec(robot="tripteron", workspace=box, angles=None))
    missed = [
        evaluate_design(task, [0.25, 0.25], proofs=p)["misses workspace"] for p in (False, True)
    ]
    assert missed[0] == 0.0 < missed[1]
    with pytest.raises(ModelError, match=r"leg 1: type-I measure, at pose \[0.005, 0.23, 0.005\]"):
        search(task.spec)


def test_a_search_finds_a_larger_proved_cube_with_links_no_longer(found):
    front, _ = found
    start = proved_cube(start_design(front.task))
    best = Design(front.task, front.robot(0))
    cube = proved_cube(best)
    assert cube.edge > 1.3 * start.edge
    assert best.quantity("links") <= 1.39 + 1e-9
    limits = [leg.limits for leg in best.robot.legs]
    assert limits == [leg.limits for leg in front.task.robot.legs]
    poses = best.poses
    assert (np.abs(pteron.inverse_kinematics(best.robot, poses)) <= 0.3).all()


def test_no_design_of_the_front_betters_another(found):
    costs = found[0].objectives * [-1.0, 1.0]
    for one in costs:
        assert not ((costs <= one).all(axis=1) & (costs < one).any(axis=1)).any()


@CLIENTS
def test_a_search_that_was_ended_goes_on_to_the_same_front(found, tmp_path):
    front, folder = found
    again = tmp_path / "generations"
    shutil.copytree(folder, again)
    for chunk in sorted(again.glob("*/0*.parquet"))[2:]:
        chunk.unlink()
    assert search(spec_of(), folder=again).designs.equals(front.designs)
    with pytest.raises(OutputError, match=r"another plan \(spec.search.seed 0, not 1; "):
        search(spec_of(), folder=again, seed=1)
    heavy = pteron.save(replace(pteron.load("quadrupteron"), gravity=(0, 0, -1.6)), tmp_path / "r")
    with pytest.raises(OutputError, match=r"robot quadrupteron: gravity \[0.0, 0.0, -9.81\], not"):
        search(spec_of(robot=str(heavy)), folder=again)


@CLIENTS
def test_processes_find_the_same_front_and_go_on_where_one_ended(found, tmp_path):
    front, folder = found
    again = tmp_path / "generations"
    shutil.copytree(folder, again)
    for chunk in sorted(again.glob("*/0*.parquet"))[1:]:
        chunk.unlink()
    assert search(spec_of(), folder=again, workers=2).designs.equals(front.designs)
    written = {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*.parquet")}
    assert written == {f.relative_to(again): f.read_bytes() for f in again.rglob("*.parquet")}


@CLIENTS
def test_a_checkpoint_that_is_damaged_is_computed_again(found, tmp_path):
    front, folder = found
    again = tmp_path / "generations"
    shutil.copytree(folder, again)
    first, second, third, *_ = sorted(again.glob("*/0*.parquet"))
    data = bytearray(first.read_bytes())
    data[len(data) // 2] ^= 1
    first.write_bytes(data)
    second.write_bytes(second.read_bytes()[:-100])
    third.write_bytes(second.read_bytes())
    assert search(spec_of(), folder=again).designs.equals(front.designs)


def test_what_changed_is_told_in_words(found):
    summary = FrontReport(found[0])
    page = summary.page()
    assert "| cube | 167.2 mm |" in page
    assert "cube proved: every position in the cube with edge" in page
    assert "slider of leg 1:" in page
    best = summary.selection[0]
    lengths = [c for c in best.changes if c.what.startswith("upper length")]
    assert lengths
    assert all(" mm -> " in change.words for change in lengths)


def workspace_spec(**given):
    variables = [
        {"moves": f"legs.{key}_length", "range": (0.1, 0.35)} for key in ("upper", "lower")
    ]
    usual = {
        "variables": variables,
        "workspace": {"low": (-0.05, -0.05, -0.05), "high": (0.05, 0.05, 0.05)},
        "angles": (-0.2, 0.2),
        "objectives": [{"minimise": "links"}],
        "requirements": [],
    }
    return spec_of(**usual | given)


@CLIENTS
def test_a_survey_streams_and_goes_on(tmp_path):
    asked = workspace_spec()
    asked = asked.model_copy(
        update={"workspace": asked.workspace.model_copy(update={"samples": 3})}
    )
    front = survey(asked, 500, tmp_path / "survey")
    assert front.evaluated == 512
    table = pl.read_parquet(tmp_path / "survey" / "*.parquet")
    good = table.filter(pl.col("misses workspace") == 0.0)
    assert front.designs["links"][0] == good["links"].min()
    next((tmp_path / "survey").glob("00000001-*.parquet")).unlink()
    again = survey(asked, 500, tmp_path / "survey")
    assert again.designs.equals(front.designs)
    design = FrontReport(front).selection[0]
    assert [proof.holds for proof in design.workspace] == [True, True]


def test_what_cannot_be_is_told_with_what_comes_nearest():
    wide = {"center": (0.0, 0.0, 0.0), "edge": 0.9}
    asked = workspace_spec(workspace=wide, requirements=[{"quantity": "links", "most": 0.9}])
    pattern = r"none of 16 designs .* the workspace is not kept \(leg \d: .* links at most 0.9 is"
    with pytest.raises(ModelError, match=pattern):
        search(asked)


FAULTS = {
    "range = [0.3, 0.1]": r"variables, item 1: range: \[0.3, 0.1\] given, whose range is empty",
    'range = [0.1, 0.3]\ncolour = "red"': r"variables, item 1: colour: unknown key",
    "range = [100, 300]": r"variables, item 1: range: \[100.0, 300.0\] m given: are these mm\?",
    "range = [-0.1, 0.3]": r"variables, item 1: range: -0.1 m given, but a length is above 0",
}
MORE = {
    "": r"objectives: missing",
    '[[objectives]]\nmaximise = "cub"': r"'cub' is no quantity: .*did you mean \"cube\"\?",
    '[[objectives]]\nmaximise = "cube"\nminimise = "links"': r"either maximise or minimise",
    '[[objectives]]\nminimise = "drive_load"': r"no drive of quadrupteron has max_force",
    '[[objectives]]\nminimise = "links"\n[workspace]\nlow = [0, 0, 0]\nedge = 1': r"a box has low",
    '[[objectives]]\nminimise = "links"\n[workspace]\nlow = [0, 0, 0]\nhigh = [90, 90, 90]': (
        r"workspace: x, y, z up to 90: are these mm\?"
    ),
    '[[objectives]]\nminimise = "links"\n[workspace]\ncenter = [0, 0]\nedge = 0.1': r"x y z of qua",
    '[[objectives]]\nminimise = "accuracy"': r"accuracy: needs a table \[errors\]",
    '[[objectives]]\nminimise = "stiffness"': r"stiffness: needs a table \[elasticity\]",
    '[[objectives]]\nminimise = "cycle_energy"': r"cycle_energy: needs \[\[cycles\]\]",
    '[[objectives]]\nmaximise = "motor_margin"\n[motors]\nfile = "no.csv"': r"motors: .*no\.csv",
    '[[objectives]]\nmaximise = "scale"': r"scale: of a workspace that floats",
    '[[objectives]]\nmaximise = "cube"\n[workspace]\nedge = 0.1': r"cube: not with a workspace",
    '[[objectives]]\nmaximise = "cube"\n[payload]\nmass = -1': r"payload\.mass: -1 given",
    '[[objectives]]\nmaximise = "cube"\n[[cycles]]\npoints = [[0, 0, 0], [90, 0, 0]]': (
        r"cycles, item 1: x, y, z up to 90: are these mm\?"
    ),
    '[[objectives]]\nmaximise = "cube"\n[[cycles]]\nscale = 1\ntimes = [0, 1]': r"times go with po",
}


@pytest.mark.parametrize(
    ("body", "pattern"),
    [
        *((f'{text}\n[[objectives]]\nmaximise = "cube"', why) for text, why in FAULTS.items()),
        *((f"range = [0.1, 0.3]\n{text}", pattern) for text, pattern in MORE.items()),
    ],
)
def test_faults_of_a_spec_are_told(tmp_path, body, pattern):
    path = tmp_path / "spec.toml"
    path.write_text(f'robot = "quadrupteron"\n[[variables]]\nmoves = "legs.upper_length"\n{body}\n')
    with pytest.raises(DataError, match=pattern) as told:
        Task.from_spec(read_spec(path))
    assert str(told.value).startswith(f"{path}: ")


def test_all_faults_of_variables_are_told_at_once():
    moves = ["legs.uper_length", "legs[7].upper_length", "legs.guide_point.w", "upper_length"]
    variables = [{"moves": one, "range": (0.1, 0.2)} for one in moves]
    with pytest.raises(DataError, match=r"4 faults") as told:
        Task.from_spec(spec_of(variables=variables))
    for text in ('did you mean "upper_length"?', "no leg 7", ".w is none of", "is not a path"):
        assert text in str(told.value)


@CLIENTS
def test_the_command_writes_what_it_finds(tmp_path):
    """Planar, so that it is quick; and the same command again reads what was evaluated."""
    spec = tmp_path / "spec.toml"
    spec.write_text(
        'robot = "five-bar"\n'
        '[[variables]]\nmoves = "legs.lower_length"\nby = "factor"\nrange = [0.7, 1.3]\n'
        "[workspace]\nlow = [-0.02, 0.01]\nhigh = [0.02, 0.05]\n"
        '[[objectives]]\nminimise = "links"\n[[objectives]]\nminimise = "condition"\n'
        "[search]\npopulation = 6\ngenerations = 2\nrefined = 1\n"
    )
    folder = tmp_path / "found"
    line = f"design {spec} --out {folder} --json"
    data = json.loads(done(line))
    names = ["best-links.toml", "best-condition.toml", "compromise.toml"]
    for name in ("front.csv", "front.parquet", "front.png", "report.md", "design.json", *names):
        assert (folder / name).stat().st_size > 100
    rows = pl.read_csv(folder / "front.csv")
    assert rows.columns == ["legs.lower_length", "links (m)", "condition"]
    best = pteron.load(folder / "best-links.toml")
    assert best.name == "five-bar-best-links"
    chosen = next(one for name, one in data["chosen"].items() if "best-links" in name)
    assert chosen["workspace_proved"] == [True]
    expect_machine(chosen["machine"], best, "design.json")
    expect_machine(data["machine"], pteron.load("five-bar"), "design.json")
    with pytest.raises(DataError, match="dimensions differ from those of five-bar-best-links"):
        expect_machine(data["machine"], best, "design.json")
    assert chosen["links"] == pytest.approx(rows["links (m)"].min())
    again = run(line)
    assert json.loads(again.stdout) == data
    assert "resumed; an earlier run has begun 2 generations" in again.stderr
    assert "--sweep: needs --out" in refused(f"design {spec} --sweep 10")


LOADED = {
    "robot": "five-bar",
    "variables": [{"moves": "legs.lower_length", "by": "factor", "range": (0.8, 1.3)}],
    "workspace": {"sides": (0.05, 0.03)},
    "payload": {"mass": 0.3},
    "cycles": [
        {"points": [(-0.02, 0.0), (0.02, 0.01)], "duration": 0.4, "dwell": 0.1},
        {"points": [(0.02, 0.01), (-0.02, 0.0)], "times": (0.0, 0.3)},
    ],
    "errors": {"encoder": 1e-4, "length": 5e-5},
    "elasticity": {"force": 10.0, "actuators": 300.0},
    "objectives": [{"minimise": "force"}, {"minimise": "deflection"}],
    "requirements": [
        {"quantity": "accuracy", "most": 0.001},
        {"quantity": "cycle_force", "most": 10.0},
        {"quantity": "cycle_energy", "most": 10.0},
        {"quantity": "type_ii", "least": 0.1},
        {"quantity": "clearance", "least": -0.1},
    ],
    "search": {"population": 4, "generations": 2, "refined": 1},
}


@pytest.fixture(scope="module")
def loaded():
    return FrontReport(search(Spec.model_validate(LOADED)))


@CLIENTS
def test_no_state_of_a_machine_designed_for_loads_breaks_a_bound(loaded):
    """A workspace that floats has its place in the results; everywhere in it what is told holds."""
    data = loaded.as_dict()
    for one in loaded.selection:
        machine, told = one.design.robot, data["chosen"][one.name]
        rng, half = np.random.default_rng(0), np.array([0.025, 0.015])
        poses = told["workspace_center"] + half * rng.uniform(-1.0, 1.0, (20_000, 2))
        assert keeps(machine, conditions(machine, type_i=0.05, type_ii=0.1), poses).all()
        moves = rng.normal(size=(2, *poses.shape))
        moves /= np.linalg.norm(moves, axis=-1, keepdims=True)
        forces = pteron.drive_forces(with_payload(machine, 0.3), poses, moves[0], 10.0 * moves[1])
        assert 0.95 * told["force"] < np.abs(forces).max() <= told["force"]
        poses, elastic = poses[:2000], Elasticity(300.0)
        assert (10.0 / stiffness(machine, poses, elastic).least <= told["deflection"] * 1.001).all()
        errors = pose_error(machine, poses, Tolerances(joints=1e-4, length=5e-5)).parts
        signs = rng.choice([-1.0, 1.0], (2000, errors.shape[-1], 1))
        off = np.linalg.norm((errors @ signs)[..., 0], axis=-1)
        assert (off <= told["accuracy"]).all()
        assert told["accuracy"] <= 0.001
        assert told["workspace_proved"] == [True]


@CLIENTS
def test_a_report_tells_how_far_each_quantity_is_known_and_what_was_asked(loaded):
    page = loaded.page()
    for text in (
        "- accuracy at most 0.001\n",
        "- type_ii at least 0.1\n",
        "- a payload of 0.3 kg\n",
        "- cycle 1: 2 points in 0.4 s, then 0.1 s of rest\n",
        "workspace centred at (",
        ": exact over all directions, at 25 sampled poses",
        "; the proof is of at least 0.1\n",
    ):
        assert text in page
    assert "nan" not in page
    center = loaded.selection[0].design.cube.center
    row = loaded.table().row(0, named=True)
    assert [row["center x (m)"], row["center y (m)"]] == center.tolist()
    wide = Task.from_spec(Spec.model_validate(LOADED | {"workspace": {"sides": (0.4, 0.4)}}))
    design = Design(wide, wide.robot)
    assert np.isnan(design.quantity("force"))
    assert "of 25 sampled poses are out of reach" in design.missing_reason("force")


def test_changes_are_told_by_one_rule():
    told = Change("radius", 0.2, 0.185, "m").words, Change("x", -0.2, -0.185, "m").words
    assert told == ("radius 200.0 mm -> 185.0 mm (-7.5 %)", "x -200.0 mm -> -185.0 mm (-7.5 %)")
    assert Change("x", -0.1, 0.05, "m").relative_change == "+150.0 mm"
    assert Change("force", np.nan, 2.0, "N").words == "force none -> 2 N ()"


def test_a_plan_has_no_keys_that_are_left_out(task):
    """So that a folder goes on where later versions have further keys."""
    assert set(task.plan) == {"robot", "spec", "pteron", "definition of its quantities"}
    assert not {"payload", "cycles", "errors", "elasticity", "motors"} & set(task.plan["spec"])
    boxed = workspace_spec(objectives=[{"minimise": "force"}])
    assert "sides" not in Task.from_spec(boxed).plan["spec"]["workspace"]


def test_the_shortest_time_brings_a_drive_to_its_limit():
    drive = pteron.legs.Drive(coulomb=0.05, viscous=0.01, max_force=0.6)
    robot = pteron.load("five-bar")
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    motion = pick_and_place(robot, scale=0.1, duration=0.5, samples=61)

    def most(time):
        rate = motion.duration / time
        state = motion.pose, rate * motion.velocity, rate**2 * motion.acceleration
        return np.abs(pteron.drive_forces(robot, *state)).max()

    time = shortest_time(robot, motion)
    assert most(time) == pytest.approx(0.6)
    assert all(most(slower * time) < 0.6 for slower in (1.01, 1.5, 5.0))
    fast = replace(drive, max_force=None, max_speed=2.0)
    robot = replace(robot, legs=tuple(replace(leg, drive=fast) for leg in robot.legs))
    speeds = np.abs(pteron.kinematics.joint_rates(robot, motion.pose, motion.velocity).actuated)
    assert shortest_time(robot, motion) == pytest.approx(0.5 * speeds.max() / 2.0)


@pytest.mark.parametrize("kind", ["curve", "winding"])
def test_the_shortest_time_keeps_what_the_motor_gives_at_speed(kind):
    given = {
        "curve": {"curve": ((0.0, 2.0), (0.5, 2.0), (6.0, 0.0))},
        "winding": {"winding": pteron.legs.Winding(1.0, 0.05, 4.0)},
    }
    drive = pteron.legs.Drive(coulomb=0.05, viscous=0.01, ratio=10.0, **given[kind])
    robot = pteron.load("five-bar")
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    motion = pick_and_place(robot, scale=0.1, duration=0.5, samples=61)

    def most(time):
        rate = motion.duration / time
        state = motion.pose, rate * motion.velocity, rate**2 * motion.acceleration
        rates = np.abs(pteron.kinematics.joint_rates(robot, *state[:2]).actuated)
        forces = pteron.drive_forces(robot, *state)
        if kind == "curve":
            return (np.abs(forces) / np.interp(rates, *np.array(drive.curve).T)).max()
        moving = pteron.kinematics.joint_rates(robot, *state[:2]).actuated
        return np.abs((forces / 0.5 + 0.5 * moving) / 4.0).max()

    time = shortest_time(robot, motion)
    assert most(time) == pytest.approx(1.0, rel=1e-6)
    assert all(most(slower * time) < 1.0 for slower in (1.01, 1.5, 5.0))


def test_the_margin_of_a_motor_is_the_most_at_any_ratio():
    robot = pteron.load("five-bar")
    found = size(robot, pick_and_place(robot, scale=0.1, duration=0.3, samples=61), dwell=0.1)
    motor = Motor("small", 1e-5, 0.3, 0.9, 300.0)
    for one in best_motors(found, [motor]):
        for share, fits in ((0.999, True), (1.001, False)):
            chosen = choose(found, [motor], margin=share * one.margin)
            assert next(fit for fit in chosen if fit.leg == one.leg).fits == fits


@CLIENTS
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc here")
@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("kind", [["--workers", "2"], ["--workers", "2", "--sweep", "2000"]])
def test_ctrl_c_while_workers_begin_is_one_line(tmp_path, kind, whole):
    """They import for seconds, and hear the terminal's Ctrl-C as the command does."""

    def alive():
        """Return the processes of the command's session that have not ended."""
        found = []
        for file in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                state, _, _, session = file.read_text().rpartition(")")[2].split()[:4]
                if session == str(process.pid) and state != "Z":
                    found.append(int(file.parent.name))
        return found

    (tmp_path / "search.toml").write_text(tomlkit.dumps(spec_of().model_dump(exclude_none=True)))
    given = [sys.executable, "-m", "pteron", "design", "search.toml", "--out", "out", *kind]
    process = subprocess.Popen(
        given, stderr=subprocess.PIPE, text=True, cwd=tmp_path, start_new_session=True
    )
    while len(alive()) < 3:  # the command, what keeps track of its resources, and a worker
        assert process.poll() is None
        time.sleep(0.02)
    (os.killpg if whole else os.kill)(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=100)
    assert (process.returncode, told) == (130, "Interrupted\n")
    end = time.monotonic() + 20.0  # what keeps track of its resources ends after it
    while alive() and time.monotonic() < end:
        time.sleep(0.05)
    assert not alive()

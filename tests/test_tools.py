"""Payloads and tools: in the file, on the command line, in Python and in exported code."""

import json
import re
from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import polars as pl
import pytest
from commands import done, refused
from exported_code import compiled
from mechanisms import CLIENTS, states
from scipy.spatial.transform import Rotation

import pteron
from pteron.export import export_fmu
from pteron.manipulator import Tool
from pteron.motion import pick_and_place, size, with_payload, with_tool
from pteron.workspace import home_pose

GRIPPER = Tool("gripper", (0.0, 0.0, -0.08), 0.3, (0.01, 0.0, -0.03), 2e-4)
PEN = Tool("Pen 2", (0.0, 0.02, -0.1), 0.05)
TENSOR = (2e-4, 1e-5, 0.0, 3e-4, 0.0, 2.5e-4)


def machine(name):
    return pteron.load(name)


def equipped(name, *tools):
    return replace(machine(name), tools=tools or (GRIPPER, PEN))


def test_tools_stand_in_the_file_and_old_files_have_none(tmp_path):
    robot = equipped("quadrupteron")
    assert pteron.load(pteron.save(robot, tmp_path / "robot.toml")) == robot
    assert pteron.load("quadrupteron").tools == ()
    assert hash(robot) != hash(machine("quadrupteron"))
    ankle = equipped("ankle", replace(GRIPPER, central_inertia=TENSOR))
    assert pteron.load(pteron.save(ankle, tmp_path / "ankle.toml")).tools == ankle.tools


@pytest.mark.parametrize(
    ("name", "inertia"), [("quadrupteron", 2e-4), ("stewart", TENSOR), ("five-bar", 2e-4)]
)
def test_a_mounted_tool_is_a_payload_with_another_centre_point(name, inertia):
    robot = equipped(name, replace(GRIPPER, central_inertia=inertia))
    mounted = with_tool(robot, "gripper")
    by_hand = with_payload(machine(name), 0.3, GRIPPER.center_of_mass, inertia)
    assert mounted.platform == replace(by_hand.platform, tool=GRIPPER.point)
    assert mounted.tools == ()
    assert with_tool(equipped(name, PEN), "Pen 2") == with_payload(
        replace(machine(name), platform=replace(machine(name).platform, tool=PEN.point)), 0.05
    )
    with pytest.raises(pteron.DataError, match="no tool 'pen'; it has gripper"):
        with_tool(robot, "pen")
    with pytest.raises(pteron.DataError, match=r"no tool 'pen', nor any other; .* \[\[tools\]\]"):
        with_tool(machine(name), "pen")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("mass = 1.0", "tools, item 1: name"),
        ('name = "a"\nmass = -1.0', "tools, item 1: mass: -1 kg is negative"),
        ('name = "a"\nweight = 1.0', "weight: unknown key"),
        ('name = "a"\n[[tools]]\nname = "a"', "tools, item 2: name: 'a' is listed twice"),
        (f'name = "a"\ncentral_inertia = {list(TENSOR)}', "one number expected for a 3T1R"),
        ('name = "a"\npoint = [1.0, 2.0]', "tools, item 1: point"),
    ],
)
def test_a_tool_with_a_mistake_is_told_by_its_number(tmp_path, keys, words):
    text = pteron.save(machine("quadrupteron"), tmp_path / "robot.toml").read_text()
    (tmp_path / "bad.toml").write_text(text.replace("[platform]", f"[[tools]]\n{keys}\n[platform]"))
    with pytest.raises(pteron.ModelError) as caught:
        pteron.load(tmp_path / "bad.toml")
    assert words in " ".join(str(caught.value).split())


def test_the_command_carries_what_python_does(tmp_path):
    path = pteron.save(equipped("five-bar", GRIPPER), tmp_path / "robot.toml")
    options = "--payload 0.4@0.01,-0.02,0@3e-4 --tool gripper --within here --friction 0 --json"
    data = json.loads(done(f"size {path} {options}"))
    mounted = with_tool(path, "gripper")
    carrying = with_payload(mounted, 0.4, (0.01, -0.02, 0.0), 3e-4)
    found = size(carrying, pick_and_place(mounted, home_pose(mounted)))
    for key in ("peak_force", "rms_force"):
        np.testing.assert_allclose(
            [row[key] for row in data["drives"]], getattr(found, f"{key}s"), rtol=1e-12
        )
    assert (data["payload"], data["payload_center"], data["tool"]) == (
        0.4,
        [0.01, -0.02, 0.0],
        "gripper",
    )
    said = done(f"size {path} --tool gripper --payload 0.4@0,0,-0.03 --within here")
    assert "with tool gripper and 0.4 kg at (0, 0, -0.03) m, standard pick-and-place cycle" in said


def test_a_simulation_carries_a_payload_at_its_centre(tmp_path):
    path, table = (
        pteron.save(equipped("five-bar", GRIPPER), tmp_path / "robot.toml"),
        tmp_path / "run.csv",
    )
    options = "--tool gripper --payload 0.4@0,0,-0.08 --duration 0.4 --step 5e-4"
    data = json.loads(done(f"simulate {path} {options} --out {table} --json"))
    assert (pl.read_csv(table)["payload"] == 0.4).all()
    mounted = with_tool(path, "gripper")
    cycle = pick_and_place(mounted, home_pose(mounted), duration=0.4)
    wanted = size(
        with_payload(mounted, 0.4), cycle
    ).rms_forces  # a 2T platform feels the mass alone
    assert [row["rms_force"] for row in data["drives"]] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--payload heavy", ["--payload: 'heavy' given; MASS, MASS@X,Y,Z or"]),
        ("--payload 1@0,0", ["--payload: '1@0,0' given"]),
        ("--payload 1@0,0,0@1@2", ["such as 0.5@0,0,-0.03"]),
        ("--payload -1@0,0,0", ["payload: -1.0 given"]),
        ("--payload nan", ["payload: nan given"]),
        ("--payload 1@0,0,0@-1", ["inertia"]),
        ("--tool pen", ["no tool 'pen'"]),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(options, words):
    refused(f"cycle five-bar {options}", *words)


def test_exported_code_has_each_tools_numbers(tmp_path):
    robot = equipped("quadrupteron", GRIPPER, PEN, replace(PEN, name="pen-2"), Tool("*/ (*"))
    pteron.export_c(robot, ["set_payload", "set_payload_base"], tmp_path)
    source = (tmp_path / "quadrupteron.c").read_text()
    found = dict(
        re.findall(r"const double quadrupteron_(tool_\w+)\[\d\] = \{(.*?)\};", source, re.S)
    )
    assert len(found) == 12

    def numbers(name):
        return [float(x) for x in re.findall(r"^\s*\(?(\S+?)\)?,? /\*", found[name], re.M)]

    assert numbers("tool_gripper_mass") == [0.3]
    assert numbers("tool_gripper_center") == [0.01, 0.0, -0.03]
    assert numbers("tool_gripper_inertia") == [2e-4]
    assert numbers("tool_pen_2_center") == list(PEN.point)
    header = (tmp_path / "quadrupteron.h").read_text()
    assert "Tool gripper, its centre point at 0 0 -0.08 m: mass of set_payload." in header
    assert "Tool ?/ ??" in header
    pteron.export_st(robot, ["set_payload"], tmp_path)
    block = (tmp_path / "Quadrupteron_SetPayload.st").read_text()
    assert "mass := [0.3], center := [0.01, 0.0, -0.03]" in block
    assert "Tool" not in (tmp_path / "quadrupteron.h").read_text().split("set_payload(")[-1]


@CLIENTS
@pytest.mark.parametrize(("name", "inertia"), [("par4", 2e-4), ("stewart", TENSOR)])
def test_exported_code_carries_the_tool_that_it_is_written_with(tmp_path, name, inertia):
    robot = equipped(name, replace(GRIPPER, central_inertia=inertia), PEN)
    file = pteron.save(robot, tmp_path / "robot.toml")
    done(f"export {file} --tool gripper --function inverse_dynamics --c {tmp_path / 'c'}")
    text = (tmp_path / "c" / f"{name}.c").read_text()
    table = re.search(r"_parameters\[\d+\] = \{(.*?)\};", text, re.S)[1]
    written = [float(x) for x in re.findall(r"^\s*\(?(\S+?)\)?,? /\*", table, re.M)]
    mounted = with_tool(robot, "gripper")
    np.testing.assert_array_equal(written, pteron.parameters(mounted))
    assert "tool_" not in text
    call, _ = compiled(mounted, ["inverse_dynamics"], tmp_path / "c")
    state = [part[0] for part in states(robot, 1)]
    expected = pteron.inverse_dynamics(mounted, *state)
    _, forces = call("inverse_dynamics", *state, np.array(written), sizes=[expected.shape])
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    refused(f"export {file} --tool saw --c {tmp_path / 'd'}", "no tool 'saw'; it has gripper")
    refused(f"export {file} --tool gripper --base a.json --c {tmp_path / 'd'}", "not with --base")
    assert not (tmp_path / "d").exists()


@CLIENTS
def test_an_fmu_lists_the_tools(tmp_path):
    (path,) = export_fmu(equipped("quadrupteron", GRIPPER), tmp_path)
    told = ZipFile(path).read("modelDescription.xml").decode()
    assert "Tool gripper, its centre point at 0 0 -0.08 m: mass := [0.3]" in told


@pytest.mark.parametrize(
    ("name", "inertia"),
    [
        ("ankle", (0.002, 1e-4, -2e-4, 0.0015, 3e-4, 0.0018)),
        ("wrist", (0.002, 1e-4, -2e-4, 0.0015, 3e-4, 0.0018)),
        ("quadrupteron", 0.002),
    ],
)
def test_tools_turn_with_the_machine(name, inertia):
    """A 2R platform's frame is the base's at angles zero, so that its tools have other numbers."""
    tool = Tool("pen", (0.02, -0.01, 0.05), 0.4, (0.01, 0.02, 0.03), inertia)
    robot = replace(pteron.load(name), tools=(tool,))
    turn = Rotation.random(rng=3).as_matrix()
    pose = pteron.random_poses(robot, 5, seed=1)
    rng = np.random.default_rng(2)
    motion = [pose, *rng.normal(size=(2, *pose.shape))]
    moved = [part.copy() for part in motion]
    for part in moved:
        if len(robot.platform.lengths) == 3:
            part[:, :3] = part[:, :3] @ turn.T
    np.testing.assert_allclose(
        pteron.inverse_dynamics(with_tool(pteron.turned(robot, turn), "pen"), *moved),
        pteron.inverse_dynamics(with_tool(robot, "pen"), *motion),
        rtol=0,
        atol=1e-10,
    )

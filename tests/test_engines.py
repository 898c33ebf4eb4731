"""The machine in other engines: exported files load there, and say what the library says."""

import re
import runpy
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import descriptions
import mechanisms
import mujoco
import numpy as np
import pytest
import tilting
import trees
from mechanisms import CATALOG, random_machine, relative_error, with_elbows

import pteron
from pteron.export import export_mjcf, export_pinocchio, export_sdf, export_urdf, pinocchio_model
from pteron.export.engines import coordinates, mjcf, tree
from pteron.export.engines.links import roll_pitch_yaw
from pteron.export.engines.parts import bodies_at_zero, moved_point, place

COUNT = 20
RANDOM = ["PPP", "SSS", "PRSU", "PRSSI", "RRRR", "CL", "CCU", "CPR"]
"""The letters are those of `random_machine`."""

TILTING = [f"{motion} {' '.join(kinds)}" for motion, kinds in tilting.LEGS.items()]
XYZ = "3T3R UPS xyz"
EACH = [
    f"{motion} {kind}"
    for motion, kinds in tilting.LEGS.items()
    for kind in kinds
    if motion != "3T2R" or kind in ("PRUR", "RPUR")  # others do not hold it alone
]
EACH += ["3T3R PRRS", "3R SRRR"]

GATE = ("quadrupteron", "tripteron", "delta-4", "par4", "five-bar", "3-prr", "PRSU", "PRSSI", "CL")
GATE += tuple(TILTING)
"""Every closure under every platform, every kind of leg; see `mechanisms.GATE`."""

ENGINES = {
    "MJCF in MuJoCo": trees.MuJoCo,
    "Python in Pinocchio": trees.Pinocchio,
    "URDF in Pinocchio": trees.PinocchioURDF,
    "SDF in Drake": trees.Drake,
}
NEEDS = {"MuJoCo": "mujoco", "Pinocchio": "pinocchio", "Drake": "pydrake"}


def machine(name):
    """Return a machine of the catalog, or one drawn at random, states of it and a home pose."""
    if name in CATALOG:
        return CATALOG[name], mechanisms.states(CATALOG[name], COUNT), None
    motion, *kinds = name.split()
    if kinds:
        angles = "xyz" if kinds[-1] == "xyz" else "rpy"
        robot, home = tilting.machine(motion, [k for k in kinds if k != "xyz"], 3, angles)
        return robot, tilting.states(robot, home, COUNT), home
    robot = random_machine(0, name)
    return robot, descriptions.states(descriptions.describe(robot), COUNT, 0), None


EVERY = mechanisms.in_turn(
    [*CATALOG, *RANDOM, *TILTING, *EACH, XYZ], GATE, share=4, argument="case", indirect=True
)


@pytest.fixture(scope="module")
def case(request):
    return machine(request.param)


@EVERY
@pytest.mark.parametrize("engine", ENGINES)
def test_forces_through_the_closure(case, engine):
    robot, motion, home = case
    pytest.importorskip(NEEDS[engine.split()[-1]])
    if robot.platform.slides and engine == "Python in Pinocchio":
        with pytest.raises(pteron.ModelError, match="coupled joints"):
            pinocchio_model(robot)
        return
    forces, jacobian, gap = trees.projected(robot, ENGINES[engine](robot, home), *motion)
    assert gap < 1e-13
    assert relative_error(jacobian, pteron.jacobian(robot, motion[0])) < 1e-10
    assert relative_error(forces, pteron.inverse_dynamics(robot, *motion)) < 1e-8


@pytest.mark.clients
@pytest.mark.parametrize("name", mechanisms.TILTED)
@pytest.mark.parametrize("engine", ENGINES)
def test_files_of_the_catalogs_tilting_machines_have_its_forces(name, engine):
    pytest.importorskip(NEEDS[engine.split()[-1]])
    robot = mechanisms.TILTED[name]
    poses = pteron.random_poses(robot, COUNT, seed=1, type_ii=0.1)
    rates = np.random.default_rng(1).normal(size=(2, *poses.shape))
    forces, jacobian, gap = trees.projected(robot, ENGINES[engine](robot), poses, *rates)
    assert gap < 1e-13
    assert relative_error(jacobian, pteron.jacobian(robot, poses)) < 1e-10
    assert relative_error(forces, pteron.inverse_dynamics(robot, poses, *rates)) < 1e-8


@mechanisms.NIGHTLY
@pytest.mark.parametrize("name", EACH)
def test_ten_random_machines_of_each_platform_that_tilts_with_each_leg(name):
    motion, kind = name.split()
    found = 0
    for seed in range(20):
        if found == 10:
            return
        angles = "xyz" if seed % 2 and "3R" in motion else "rpy"
        robot, home = tilting.machine(motion, (kind,), seed, angles)
        states = tilting.states(robot, home, 200, seed)
        if len(states[0]) < 100:  # a crank drawn so that it does not reach
            continue
        found += 1
        engine = trees.MuJoCo(robot, states[0][0], spin=False)
        forces, jacobian, gap = trees.projected(robot, engine, *states)
        assert gap < 1e-13
        assert relative_error(jacobian, pteron.jacobian(robot, states[0])) < 1e-10
        assert relative_error(forces, pteron.inverse_dynamics(robot, *states)) < 1e-8
    assert found == 10


def test_working_modes_and_turned_machines():
    bent = with_elbows(CATALOG["quadrupteron-oblique"], "+--+")
    for robot in (bent, mechanisms.MECHANISMS["delta on a wall"]):
        motion = mechanisms.states(robot, COUNT)
        forces, _, gap = trees.projected(robot, trees.MuJoCo(robot), *motion)
        assert gap < 1e-13
        assert relative_error(forces, pteron.inverse_dynamics(robot, *motion)) < 1e-8


@EVERY
def test_accelerations_by_constrained_dynamics(case):
    """Pinocchio's constraintDynamics, with three rows a loop, against `forward_dynamics`."""
    pin = pytest.importorskip("pinocchio")
    robot, (pose, velocity, _), home = case
    if robot.platform.slides:
        pytest.skip("the halves of a platform that slides are coupled joints")
    robot = trees.without_drives(robot)
    closed = pinocchio_model(robot, home=home)
    model, constraints, datas = closed.model, closed.constraints, closed.constraint_datas
    data = model.createData()
    pin.initConstraintDynamics(model, data, constraints, datas)
    opened = tree(robot, home)
    names = [joint.name for joint in opened.joints]
    moved = list(model.names)[1:]
    order = [names.index(name) for name in moved]
    free = [moved.index(name) for name in robot.coordinates]
    bound = np.setdiff1d(np.arange(model.nv), free)
    forces = 10.0 * np.random.default_rng(0).normal(size=pose.shape)
    found = []
    for q, dx, force in zip(coordinates(opened, pose)[:, order], velocity, forces, strict=True):
        pin.computeJointJacobians(model, data, q)
        for constraint, its_data in zip(constraints, datas, strict=True):
            constraint.calc(model, data, its_data)
        rows = pin.getConstraintsJacobian(model, data, constraints, datas)
        v = np.zeros(model.nv)
        v[free] = dx
        v[bound] = -np.linalg.pinv(rows[:, bound], rcond=1e-10) @ rows[:, free] @ dx
        settings = pin.ProximalSettings(1e-14, 1e-8, 100)
        load = closed.motors.T @ force
        found.append(
            pin.constraintDynamics(model, data, q, v, load, constraints, datas, settings)[free]
        )
    expected = pteron.forward_dynamics(robot, pose, velocity, forces)
    assert relative_error(found, expected) < 1e-7


def test_the_written_module_is_the_model_in_this_process(tmp_path):
    pytest.importorskip("pinocchio")
    robot = CATALOG["delta-4"]
    (path,) = export_pinocchio(robot, tmp_path)
    written, here = runpy.run_path(str(path))["build"](), pinocchio_model(robot)
    assert written.model == here.model
    np.testing.assert_array_equal(written.home, here.home)
    np.testing.assert_array_equal(written.motors, here.motors)
    assert list(written.constraints) == list(here.constraints)


def test_a_drives_inertia_is_armature():
    pytest.importorskip("pinocchio")
    drive = pteron.legs.Drive(rotor_inertia=2e-4, ratio=10.0)
    robot = CATALOG["delta-4"]
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    closed = pinocchio_model(robot)
    reflected = closed.motors @ np.diag(closed.model.armature) @ closed.motors.T
    ratio = robot.legs[3].ratio
    np.testing.assert_allclose(np.diag(reflected), [0.02, 0.02, 0.02, 0.02 * ratio**4])


@EVERY
def test_mjcf_opens_at_the_home_pose_with_its_loops_closed(case):
    mujoco = pytest.importorskip("mujoco")
    robot, _, home = case
    opened = tree(robot, home)
    model = mujoco.MjModel.from_xml_string(mjcf(opened))
    data = mujoco.MjData(model)
    np.testing.assert_array_equal(model.key_qpos[0], model.qpos0)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    ends = (data.site(f"{closing.name}_end").xpos for closing in opened.closings)
    seats = (data.site(f"{closing.name}_seat").xpos for closing in opened.closings)
    gaps = [np.abs(end - seat).max() for end, seat in zip(ends, seats, strict=True)]
    assert max(gaps) < 1e-9
    # Its actuators have the coordinates of the machine's logs, shafts too, and hold it there.
    joints = pteron.inverse_kinematics(robot, opened.home)
    np.testing.assert_allclose(data.actuator_length, joints, rtol=0, atol=1e-12)
    for _ in range(50):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - model.qpos0).max() < 5e-5


def test_mjcf_has_drives_and_limits():
    mujoco = pytest.importorskip("mujoco")
    drive = pteron.legs.Drive(3.0, 12.0, 0.5, 3e-5, 400.0, max_force=50.0)
    shaft = pteron.legs.Drive(0.2, 0.1, rotor_inertia=1e-3, max_force=2.0)
    robot = CATALOG["delta-4"]
    *cranks, last = robot.legs
    last = replace(last, ratio=-2.0, limits=(-1.0, 3.0), drive=shaft)
    robot = replace(robot, legs=(*(replace(leg, drive=drive) for leg in cranks), last))
    model = mujoco.MjModel.from_xml_string(mjcf(tree(robot)))
    joint = model.joint("theta1")
    np.testing.assert_allclose(joint.armature, 3e-5 * 400.0**2)
    np.testing.assert_allclose([joint.damping[0], joint.frictionloss[0]], [12.0, 3.0])
    np.testing.assert_allclose(joint.range, robot.legs[0].limits)
    np.testing.assert_allclose(model.actuator("theta1").ctrlrange, [-50.0, 50.0])
    phi = model.joint("phi")
    np.testing.assert_allclose(phi.armature, 4e-3)
    np.testing.assert_allclose([phi.damping[0], phi.frictionloss[0]], [0.4, 0.4])
    np.testing.assert_allclose(phi.range, [-1.5, 0.5])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, [-0.5, -0.5, -0.5, 0.0])
    np.testing.assert_allclose(model.actuator_gear[:, 0], [1.0, 1.0, 1.0, -2.0])


@EVERY
def test_the_parts_are_the_whole_machine(case):
    """Mass, and every body real: no moment above the sum of the other two."""
    robot, _, home = case
    opened = tree(robot, home)
    listed = zip(pteron.manipulator.parameter_data(robot), pteron.parameters(robot), strict=True)
    mass = sum(value for parameter, value in listed if parameter.kind == "m")
    np.testing.assert_allclose(sum(body.mass for body in opened.bodies), mass, rtol=1e-12)
    for body in opened.bodies:
        low, middle, high = np.linalg.eigvalsh(body.tensor)
        assert 0.0 < low <= middle <= high <= low + middle, body.name
        np.testing.assert_allclose(body.axes.T @ body.axes, np.eye(3), atol=1e-14)
    names = [joint.name for joint in opened.joints] + [body.name for body in opened.bodies]
    assert len(set(names)) == len(names)
    assert set(robot.coordinates) <= set(names)


@EVERY
def test_coordinates_close_the_loops(case):
    robot, (pose, *_), _ = case
    opened = tree(robot, pose[0])
    names = [joint.name for joint in opened.joints]
    for row in coordinates(opened, pose):
        moved = place(opened, dict(zip(names, row, strict=True)))
        for closing in opened.closings:
            ends = (moved_point(moved[k], closing.point) for k in (closing.one, closing.other))
            assert np.abs(np.subtract(*ends)).max() < 1e-13
    homes = [joint.home for joint in opened.joints]
    np.testing.assert_allclose(coordinates(opened, pose[0]), homes, rtol=0, atol=1e-13)
    # Back at zero and then home again is where they were.
    there = replace(opened, bodies=bodies_at_zero(opened))
    moved = place(there, dict(zip(names, homes, strict=True)))
    for motion, zero, body in zip(moved, there.bodies, opened.bodies, strict=True):
        np.testing.assert_allclose(moved_point(motion, zero.center), body.center, atol=1e-14)
        np.testing.assert_allclose(motion[:3, :3] @ zero.axes, body.axes, atol=1e-14)


def test_rates_of_the_chain_are_those_of_the_coordinates():
    """The joints' rates by the legs' own rows, against differences of the tree's coordinates."""
    for name in ("quadrupteron-oblique", "delta-4", "five-bar", "linear-delta"):
        robot, (pose, velocity, _), _ = machine(name)
        opened, dt = tree(robot), 1e-6
        ahead, back = (coordinates(opened, pose + way * dt * velocity) for way in (1.0, -1.0))
        found = dict(
            zip([j.name for j in opened.joints], ((ahead - back) / (2 * dt)).T, strict=True)
        )
        rates = pteron.kinematics.joint_rates(robot, pose, velocity).passive
        for i in range(robot.freedom):
            for k in range(1, 4):
                key = f"leg{i + 1}_joint{k}"
                if key in found:
                    np.testing.assert_allclose(found[key], rates[:, i, k - 1], rtol=0, atol=1e-6)


def test_every_file_is_named_after_the_machine(tmp_path):
    robot = replace(CATALOG["par4"], name='A & B <"robot"> -- 2')
    exports = (export_mjcf, export_sdf, export_urdf, export_pinocchio)
    paths = [path for export in exports for path in export(robot, tmp_path)]
    stem = paths[0].stem
    assert re.fullmatch(r"a-b-robot-2-[0-9a-f]{6}", stem)
    assert [path.name for path in paths] == [
        f"{stem}.xml",
        f"{stem}.sdf",
        f"{stem}.urdf",
        f"{stem}.closure.yaml",
        f"{stem.replace('-', '_')}_pinocchio.py",
    ]
    for path in paths:
        text = path.read_text()
        assert "changes no force" in text
        if path.suffix in (".xml", ".sdf", ".urdf"):
            ElementTree.fromstring(text)
    compile(paths[-1].read_text(), "module", "exec")


def test_what_a_file_cannot_hold_is_said_in_it():
    drive = pteron.legs.Drive(3.0, offset=1.0, rotor_inertia=1e-5, max_speed=2.0)
    robot = CATALOG["quadrupteron"]
    legs = (replace(leg, drive=drive, elbow_limits=(0.1, 3.0)) for leg in robot.legs)
    opened = tree(replace(robot, legs=tuple(legs)))
    told = "the limits of passive joints (elbow)."
    assert f"Left out: the drives' greatest speeds, {told}" in mjcf(opened)
    assert f"Left out: the motors' inertia, friction's constant part, {told}" in trees.urdf(opened)
    assert "Left out" not in mjcf(tree(CATALOG["delta"]))


@pytest.mark.parametrize(
    "name",
    mechanisms.gated(
        [*CATALOG, *mechanisms.TILTED], ["tripteron", "delta-4", "h4", "3-rpr", "ankle"]
    ),
)
def test_every_link_of_a_urdf_has_an_inertia_that_engines_take(tmp_path, name):
    path, _ = export_urdf(name, tmp_path)
    links = ElementTree.parse(path).iter("link")
    without = [link.get("name") for link in links if link.find("inertial") is None]
    assert without == ["world"]  # which has no mass for any engine
    (model,) = export_mjcf(name, tmp_path)
    mass = mujoco.MjModel.from_xml_path(str(model)).body_mass.sum()
    found = mujoco.MjModel.from_xml_path(str(path)).body_mass.sum()
    assert found == pytest.approx(mass, rel=1e-9)


def test_sdf_is_of_a_version_that_gazebo_knows():
    text = trees.sdf(tree(CATALOG["delta-4"]))
    assert ElementTree.fromstring(text).get("version") == "1.9"


def test_names_in_sdf_are_unique():
    text = trees.sdf(tree(CATALOG["delta-4"]))
    model = ElementTree.fromstring(text).find("world/model")
    names = [part.get("name") for part in model]
    assert len(set(names)) == len(names)


def test_wrong_homes_are_refused(tmp_path):
    robot = CATALOG["delta"]
    with pytest.raises(pteron.DataError, match=r"home: shape \(4,\) given, \(\.\.\., 3\) expected"):
        export_mjcf(robot, tmp_path, home=[0.0, 0.0, -0.9, 0.0])
    with pytest.raises(pteron.DataError, match="home: 2 poses given, 1 expected"):
        export_mjcf(robot, tmp_path, home=np.zeros((2, 3)))
    with pytest.raises(pteron.DataError, match="home: not an array of real numbers"):
        export_sdf(robot, tmp_path, home=["middle"] * 3)
    with pytest.raises(pteron.DataError, match="nan given, a finite number expected"):
        export_sdf(robot, tmp_path, home=[0.0, 0.0, np.nan])
    with (
        pytest.warns(pteron.UnlikelyValue, match="are these mm"),
        pytest.raises(pteron.UnreachablePose, match="leg 1"),
    ):
        export_urdf(robot, tmp_path, home=[0.0, 0.0, -900.0])
    with pytest.raises(pteron.ModelError, match="robot: int given"):
        export_sdf(3, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_leg_that_does_not_say_what_its_joints_carry_is_refused(monkeypatch):
    from pteron.legs.prr import PRREquations

    def silent(self, point, angle):
        found = spoken(self, point, angle)
        return found._replace(chain=tuple(joint._replace(body="") for joint in found.chain))

    spoken = PRREquations.motion
    monkeypatch.setattr(PRREquations, "motion", silent)
    robot = replace(CATALOG["3-prr"], name="silent")
    with pytest.raises(pteron.ModelError, match=r"leg 1: PRR: its chain's joints carry \[\]"):
        tree(robot)


EXAMPLES = {
    "new_leg.linear_delta()": "pteron.random_poses(robot, 5, type_i=0.5, type_ii=0.3)",
    "new_platform.five_ups()": "[0.0, 0.0, 0.7, 0.1, 0.1] + rng.uniform(-0.05, 0.05, (5, 5))",
}


@pytest.mark.parametrize(("machine", "poses"), EXAMPLES.items())
def test_a_kind_of_leg_and_of_platform_from_examples_is_exported(machine, poses):
    pytest.importorskip("mujoco")
    code = (
        "import sys; sys.path[:0] = ['examples', 'tests']\n"
        "import new_leg, new_platform, trees, numpy as np, pteron\n"
        f"robot, rng = {machine}, np.random.default_rng(0)\n"
        f"pose = {poses}\n"
        "motion = pose, *np.random.default_rng(0).normal(size=(2, *pose.shape))\n"
        "forces, _, gap = trees.projected(robot, trees.MuJoCo(robot), *motion)\n"
        "error = np.abs(forces - pteron.inverse_dynamics(robot, *motion)).max()\n"
        "print(gap < 1e-13 and error < 1e-8 * np.abs(forces).max())\n"
    )
    root = mechanisms.__file__.rsplit("/", 2)[0]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "True", done.stderr


def test_roll_pitch_yaw_also_where_pitch_is_upright():
    rng = np.random.default_rng(0)

    def about(axis, angle):
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[[i, j], [i, j]] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        return turn

    pitches = [*rng.uniform(-1.5, 1.5, 20), *(np.pi / 2 + d for d in (0, 1e-9, -1e-12, -np.pi))]
    for pitch in pitches:
        roll, yaw = rng.uniform(-3.0, 3.0, 2)
        turn = about(2, yaw) @ about(1, pitch) @ about(0, roll)
        angles = roll_pitch_yaw(turn)
        back = about(2, angles[2]) @ about(1, angles[1]) @ about(0, angles[0])
        np.testing.assert_allclose(back, turn, rtol=0, atol=2e-15)


@EVERY
def test_the_looks_join_up(case):
    """A leg is seen as one line: each body's looks begin where those of the one before end."""
    from pteron.export.engines.shapes import add_shapes

    robot, _, home = case
    opened = add_shapes(tree(robot, home))
    for body in opened.bodies:
        assert body.shapes, body.name
        for shape in body.shapes:
            assert np.isfinite(shape.ends).all()
            assert 0.0 < shape.radius < opened.size
    near = 0.05 * opened.size

    def touches(body, point):
        ends = np.concatenate([shape.ends for shape in body.shapes])
        return np.linalg.norm(ends - point, axis=-1).min() < near

    for closing in opened.closings:
        assert touches(opened.bodies[closing.one], closing.point)
        assert touches(opened.bodies[closing.other], closing.point)
    for body in opened.bodies:
        telescopes = body.parent != -1 and body.joints[-1].is_prismatic
        assert telescopes or touches(body, body.origin), body.name

"""Code and models of machines whose platforms tilt, run by the tools that they are for."""

import ctypes
from dataclasses import replace

import fmpy.validation
import numpy as np
import pytest
import tilting
from compiled_exports import KINDS, EmcPose, driven, kinematics, simulated, started
from exported_code import compiled
from mechanisms import CLIENTS, gated
from scipy.integrate import solve_ivp
from structured_text import Runner

import pteron
from pteron.equations.drives import drive_numbers
from pteron.export import casadi_functions, export_fmu
from pteron.kernels import numeric

CODE = ("inverse_kinematics", "direct_step", "inverse_dynamics", "jacobian", "forward_dynamics")
CODE += ("mass_matrix", "feed_forward", "joint_feed_forward")


def drawn(motion, count=3):
    """Return a machine with drives, all of its kinds of legs in it, and states of it."""
    robot, home = tilting.machine(motion, tilting.LEGS[motion], 3)
    poses, *rates = tilting.states(robot, home, 4 * count)
    far = np.abs(numeric(robot, "type_ii")(poses)[0]) > 0.05
    return driven(robot), (poses[far][:count], *(rate[far][:count] for rate in rates))


@CLIENTS
@pytest.mark.parametrize("motion", gated(tilting.LEGS, ["2R"]))
def test_c_of_a_tilting_machine_returns_what_the_library_does(tmp_path, motion):
    robot, states = drawn(motion)
    n, wrench = robot.freedom, np.random.default_rng(1).normal(size=6)
    functions = CODE if n < 6 else CODE[:3]  # a compiler takes its time
    call, header = compiled(robot, functions, tmp_path, wrench=True, specialised=True)
    assert "wrench (6): wrench on the platform at P: force, N, and moment about it" in header
    assert f"{', '.join(robot.platform.angles)} in rad\n" in header
    for x, dx, ddx in zip(*states, strict=True):
        joints = pteron.inverse_kinematics(robot, x)
        forces = pteron.inverse_dynamics(robot, x, dx, ddx, wrench)
        rates = pteron.kinematics.joint_rates(robot, x, dx).actuated
        seconds = pteron.kinematics.joint_accelerations(robot, x, dx, ddx).actuated
        given = pteron.drive_forces(robot, x, dx, ddx, wrench, smooth=True)
        results = {
            "inverse_kinematics": ((x,), joints),
            "jacobian": ((x,), pteron.jacobian(robot, x)),
            "inverse_dynamics": ((x, dx, ddx, wrench), forces),
            "forward_dynamics": ((x, dx, forces, wrench), ddx),
            "mass_matrix": ((x,), pteron.mass_matrix(robot, x)),
            "feed_forward": ((x, dx, ddx, wrench), given),
        }
        for name, (inputs, expected) in results.items():
            if name not in functions:
                continue
            status, found = call(name, *inputs, sizes=(np.size(expected),))
            assert status == 0
            np.testing.assert_allclose(
                found, np.ravel(expected), rtol=0, atol=1e-11 * np.abs(expected).max(), err_msg=name
            )
        status, found, *_ = call("direct_step", joints, x + 1e-3, sizes=(n, 1, 1))
        assert status == 0
        np.testing.assert_allclose(found, x, rtol=0, atol=1e-12)
        if "joint_feed_forward" not in functions:
            continue
        moving = joints, rates, seconds, x + 1e-3, wrench
        status, found, pose = call("joint_feed_forward", *moving, sizes=(n, n))
        assert status == 0
        np.testing.assert_allclose(pose, x, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found, given, rtol=0, atol=1e-9 * np.abs(given).max())


@CLIENTS
def test_c_of_a_hexapod_takes_every_state_of_its_reach(tmp_path):
    """The library's code has vectors along the platform's axes, exported code along the base's."""
    robot = pteron.load("stewart")
    call, _ = compiled(robot, ("inverse_dynamics",), tmp_path, wrench=True, specialised=True)
    rng = np.random.default_rng(4)
    for x in pteron.random_poses(robot, 20, seed=rng):
        state = x, *rng.normal(size=(2, 6)), 1e3 * rng.normal(size=6)
        status, found = call("inverse_dynamics", *state, sizes=(6,))
        assert status == 0
        expected = pteron.inverse_dynamics(robot, *state)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("motion", gated(tilting.LEGS, ["2R"]))
def test_structured_text_of_a_tilting_machine_returns_what_the_library_does(motion):
    robot, states = drawn(motion)
    for what in ("inverse_kinematics", "direct_step", "inverse_dynamics", "feed_forward"):
        run = Runner(pteron.kernels.program(robot, what))
        for x, dx, ddx in zip(*states, strict=True):
            known = {"pose": x, "velocity": dx, "acceleration": ddx}
            known |= {"parameters": pteron.parameters(robot), "drives": drive_numbers(robot)}
            known["joints"] = pteron.inverse_kinematics(robot, x)
            values = [known[port.name] for port in run.program.inputs]
            found = run(values)
            assert (found.valid, found.status) == (True, 0)
            for output, expected in zip(found.outputs, run.casadi(values), strict=True):
                size = np.abs(expected).max()
                np.testing.assert_allclose(output, expected, rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("motion", gated(tilting.LEGS, ["2R"]))
def test_casadi_functions_of_a_tilting_machine_take_a_wrench_of_six(motion):
    robot, states = drawn(motion)
    functions, wrench = casadi_functions(robot), np.random.default_rng(1).normal(size=6)
    for x, dx, ddx in zip(*states, strict=True):
        forces = functions["drive_forces"](x, dx, ddx, wrench)
        expected = pteron.drive_forces(robot, x, dx, ddx, wrench, smooth=True)
        np.testing.assert_allclose(np.array(forces).ravel(), expected, 1e-9)
        rates = functions["state_rates"](np.concatenate([x, dx]), forces, wrench)
        np.testing.assert_allclose(np.array(rates).ravel(), np.concatenate([dx, ddx]), 1e-7)


@CLIENTS
@pytest.mark.parametrize("motion", gated(tilting.LEGS, ["2R"]))
def test_an_fmu_of_a_tilting_machine_moves_as_the_librarys_equations(tmp_path, motion):
    """With forces, a wrench of six, and a payload, which here is another platform."""
    robot, ((pose, *_), *_) = drawn(motion)
    (path,) = export_fmu(robot, tmp_path, pose=pose)
    assert fmpy.validation.validate_fmu(str(path)) == []
    n, starts = robot.freedom, started(str(path))
    inputs = [f"{leg.joint.force}{i}" for i, leg in enumerate(robot.legs, start=1)]
    held, rest = np.array([starts[k] for k in inputs]), np.zeros(n)
    np.testing.assert_allclose(held, pteron.drive_forces(robot, pose, rest, rest), 1e-12)
    wrench = np.array([3.0, -2.0, 1.0, 0.3, -0.2, 0.1])
    mass, c = 0.3, np.array([0.02, -0.01, 0.03])
    own = np.array([[3.0, 0.2, 0.1], [0.2, 4.0, -0.3], [0.1, -0.3, 5.0]]) * 1e-3
    tensor = own + mass * (c @ c * np.eye(3) - np.outer(c, c))
    values = pteron.parameters(robot).copy()
    values[-10:] += [mass, *(mass * c), *tensor[np.triu_indices(3)]]
    load = dict(zip(("mass", *"xyz"), (mass, *c), strict=True))
    load |= {f"i{'xyz'[i]}{'xyz'[j]}": own[i, j] for i, j in zip(*np.triu_indices(3), strict=True)}
    loaded = pteron.with_parameters(robot, values)

    def rates(_, state):
        forward = pteron.drive_accelerations(loaded, state[:n], state[n:], held, wrench)
        return np.concatenate([state[n:], forward])

    expected = solve_ivp(
        rates, (0.0, 0.02), [*pose, *rest], method="DOP853", rtol=1e-11, atol=1e-13
    ).y[:, -1]
    assert np.abs(expected[:n] - pose).max() > 1e-5
    columns = zip(robot.platform.wrench_columns, wrench, strict=True)
    given = {f"wrench.{name}": value for name, value in columns}
    given |= {f"payload.{name}": value for name, value in load.items()}
    for kind in KINDS:
        result, said = simulated(str(path), kind, 0.02, **given)
        assert said == []
        coordinates = robot.platform.coordinates
        found = [result[-1][f"{word}.{c}"] for word in ("pose", "velocity") for c in coordinates]
        np.testing.assert_allclose(found, expected, 0.0, 1e-7)


LETTERS = dict(
    zip(("x", "y", "z", "roll", "pitch", "yaw", "alpha", "beta"), "xyzabcab", strict=True)
)


@CLIENTS
@pytest.mark.parametrize("motion", gated(tilting.LEGS, ["3T3R"]))
def test_linuxcnc_moves_a_tilting_machine_as_genhexkins_does(tmp_path, motion):
    """With a tool of its own, and one that the tool table makes longer: both turn about the tip."""
    robot, (poses, *_) = drawn(motion)
    tool, length = np.array([0.01, -0.02, 0.03]), 40.0
    robot = replace(robot, platform=replace(robot.platform, tool=tuple(tool)))
    library, files = kinematics(robot, tmp_path)
    assert library.kinematicsType() == 4
    name, n = files["comp"].stem, robot.freedom
    library.pin.restype = ctypes.POINTER(ctypes.c_double)
    pin = {
        key: library.pin(f"{name}.{key}".encode())
        for key in ("tool-offset", "fwd-kins-fail", "measure", "base.0.x", "platform.1.z", *"abc")
    }
    assert pin["base.0.x"][0] == pytest.approx(1e3 * robot.legs[0].guide_point[0])
    assert pin["platform.1.z"][0] == pytest.approx(1e3 * robot.legs[1].platform_point[2])
    lengths = "tool-offset" in files["hal"].read_text()
    assert lengths == bool(robot.platform.lengths) == bool(pin["tool-offset"])
    if lengths:
        pin["tool-offset"][0] = length
    degrees, upright = 180.0 / np.pi, np.array(robot.platform.frame[2])
    units = [degrees if leg.joint.unit == "rad" else 1000.0 for leg in robot.legs]
    joints = (ctypes.c_double * 16)(*[77.0] * 16)
    for pose in poses:
        p, axes = robot.platform.placement(pose)
        tip = 1e3 * (p + tool @ axes) + length * (upright - axes[2])
        seen = np.concatenate([robot.platform.directions @ tip, degrees * pose])[: len(pose)]
        seen[robot.platform.angular] = degrees * pose[robot.platform.angular]
        given = {LETTERS[c]: v for c, v in zip(robot.coordinates, seen, strict=True)}
        world = EmcPose(**given)
        assert library.kinematicsInverse(ctypes.byref(world), joints, None, None) == 0
        np.testing.assert_allclose(
            joints[:n] / np.array(units), pteron.inverse_kinematics(robot, pose), 1e-11, 1e-12
        )
        near = EmcPose(**{key: value + 0.3 for key, value in given.items()}, w=5.0)
        assert library.kinematicsForward(joints, ctypes.byref(near), None, None) == 0
        for key, _ in EmcPose._fields_:
            assert getattr(near, key) == pytest.approx(given.get(key, 0.0), abs=1e-8)
        assert pin["fwd-kins-fail"][0] == 0.0
        assert pin["a"][0] == near.a
        assert pin["measure"][0] == pytest.approx(abs(numeric(robot, "type_ii")(pose)[0]))
    nowhere = (ctypes.c_double * 16)(*[1e6 * (k + 1) for k in range(16)])
    assert library.kinematicsForward(nowhere, ctypes.byref(near), None, None) == -1
    assert pin["fwd-kins-fail"][0] == 1.0

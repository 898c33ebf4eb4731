"""MuJoCo, from Python and in C: on the tree, and on the mechanism that its constraints close.

Its equality constraints are soft, and their forces depend on how soft; but they do no work in a
motion that keeps the loops closed, so that the projection takes them out again.
"""

from __future__ import annotations

import tempfile
from ctypes import c_char_p, c_void_p
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import pteron
from peers import compiled_closure
from peers.calls import Calls
from peers.closure import Array
from peers.compiled_closure import closed_form
from peers.library import Missing, Sweep, compiled
from peers.tree import tree

__all__ = ["c_tuned", "c_usual", "python_tuned"]


def _model(robot: pteron.Manipulator, carried: bool, closed: bool = False) -> Any:
    """Return the tree; with its loops closed by constraints if asked for."""
    import mujoco

    if robot.platform.tilts:
        raise Missing("its peer is not written for platforms that tilt")
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = robot.gravity
    built: list[Any] = []
    for body in tree(robot, carried):
        parent = spec.worldbody if body.parent < 0 else built[body.parent]
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, body.rotation.ravel())
        made = parent.add_body(
            pos=body.offset,
            quat=quaternion,
            mass=body.mass,
            ipos=body.center,
            inertia=body.inertia,
            explicitinertial=True,
        )
        for axis in body.slides:
            made.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        for letter in body.hinges:
            hinge = [0.0, 0.0, 1.0] if letter == "z" else [0.0, 1.0, 0.0]
            made.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=hinge)
        built.append(made)
    legs: tuple[Any, ...] = robot.legs if closed else ()
    for i, leg in enumerate(legs):
        built[2 * i + 1].add_site(name=f"link {i}", pos=[leg.lower_length, 0.0, 0.0])
        built[-1].add_site(name=f"point {i}", pos=leg.platform_point)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"link {i}",
            name2=f"point {i}",
        )
    return spec.compile()


def python_tuned(robot: pteron.Manipulator) -> Calls:
    """Return the peer that calls the stages of MuJoCo's Newton-Euler algorithm from Python."""
    if find_spec("mujoco") is None:
        raise Missing("the package mujoco is not installed")
    import mujoco

    carried = robot.platform.turns
    model = _model(robot, carried)
    data = mujoco.MjData(model)
    position, rate, rate_of_rate = data.qpos, data.qvel, data.qacc
    tau = np.empty(model.nv)
    kinematics, rne = mujoco.mj_kinematics, mujoco.mj_rne
    com_position, com_velocity = mujoco.mj_comPos, mujoco.mj_comVel
    closure = closed_form(robot, carried)
    joints = compiled_closure.joints(closure, unbounded=False)
    forces = compiled_closure.forces(closure)

    def call(pose: Array, velocity: Array, acceleration: Array) -> Array:
        position[:], rate[:], rate_of_rate[:], rows = joints(pose, velocity, acceleration)
        # What `mj_inverse` does, less its stages for what the model has not.
        kinematics(model, data)
        com_position(model, data)
        com_velocity(model, data)
        rne(model, data, 1, tau)
        return forces(tau, rows)

    return Calls(call)


def c_tuned(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls the stages of MuJoCo's Newton-Euler algorithm in C."""
    return _c(robot, closed=False)


def c_usual(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls `mj_inverse` on the closed mechanism, and projects its forces."""
    return _c(robot, closed=True)


def _c(robot: pteron.Manipulator, closed: bool) -> Sweep:
    package = find_spec("mujoco")
    if package is None or package.origin is None:
        raise Missing("the package mujoco is not installed")
    import mujoco

    if closed and robot.platform.turns and any(any(leg.fixed_offset) for leg in robot.legs):
        raise Missing("the platform is articulated, and its bars are no bodies of the tree")
    folder = Path(package.origin).parent
    libraries = sorted(folder.glob("libmujoco.so*"))
    if not libraries or not (folder / "include" / "mujoco" / "mujoco.h").is_file():
        raise Missing("the package mujoco brings no header or no library here")
    options = ["-std=gnu11", "-fno-math-errno", *(["-DCLOSED"] if closed else [])]
    options += ["-isystem", str(folder / "include"), str(libraries[0]), "-lm"]
    options += [f"-Wl,-rpath,{folder}"]
    carried = closed or robot.platform.turns
    header, numbers = closed_form(robot, carried).in_c(unbounded=False)
    library = compiled("gcc", "mujoco_peer.c", options, version("mujoco"), header)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "tree.mjb"
        mujoco.mj_saveModel(_model(robot, carried, closed), str(path))
        return Sweep(library, c_char_p(bytes(path)), c_void_p(numbers.ctypes.data))

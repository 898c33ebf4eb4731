"""MuJoCo, from Python and in C, on the tree: soft equality constraints would not be exact."""

from __future__ import annotations

import tempfile
from ctypes import c_char_p, c_void_p
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import pteron
from peers.calls import Calls
from peers.closure import Closure
from peers.library import Missing, Sweep, compiled
from peers.tree import tree

__all__ = ["c", "python"]


def _model(robot: pteron.Manipulator) -> Any:
    import mujoco

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = robot.gravity
    built: list[Any] = []
    for body in tree(robot):
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
        made.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
        built.append(made)
    return spec.compile()


def python(robot: pteron.Manipulator) -> Calls:
    """Return the peer that calls MuJoCo's Newton-Euler algorithm from Python."""
    if find_spec("mujoco") is None:
        raise Missing("the package mujoco is not installed")
    import mujoco

    model = _model(robot)
    data = mujoco.MjData(model)
    tau = np.empty(model.nv)
    kinematics, rne = mujoco.mj_kinematics, mujoco.mj_rne
    com_position, com_velocity = mujoco.mj_comPos, mujoco.mj_comVel

    def inverse() -> None:
        """Do what `mj_inverse` does, less its stages for what the model has not."""
        kinematics(model, data)
        com_position(model, data)
        com_velocity(model, data)
        rne(model, data, 1, tau)

    return Calls(Closure.of(robot), (data.qpos, data.qvel, data.qacc), tau, inverse, False)


def c(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls MuJoCo's Newton-Euler algorithm in C."""
    package = find_spec("mujoco")
    if package is None or package.origin is None:
        raise Missing("the package mujoco is not installed")
    import mujoco

    folder = Path(package.origin).parent
    libraries = sorted(folder.glob("libmujoco.so*"))
    if not libraries or not (folder / "include" / "mujoco" / "mujoco.h").is_file():
        raise Missing("the package mujoco brings no header or no library here")
    options = ["-std=gnu11", "-isystem", str(folder / "include"), str(libraries[0]), "-lm"]
    library = compiled("gcc", "mujoco_peer.c", [*options, f"-Wl,-rpath,{folder}"])
    numbers = Closure.of(robot).numbers
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "tree.mjb"
        mujoco.mj_saveModel(_model(robot), str(path))
        return Sweep(library, c_char_p(bytes(path)), c_void_p(numbers.ctypes.data))

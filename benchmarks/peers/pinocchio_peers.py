"""Pinocchio, from Python and in C++: as one usually calls and compiles it, and tuned."""

from __future__ import annotations

import tempfile
from ctypes import c_char_p, c_int, c_void_p
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import pteron
from peers import compiled_closure
from peers.calls import Calls
from peers.closure import Array
from peers.compiled_closure import closed_form
from peers.leg_closure import printed
from peers.library import Missing, Sweep, compiled
from peers.tree import Body, tree
from pteron.kernels.passes import optimise_function

__all__ = ["c_generated", "cpp_plain", "cpp_tuned", "cpp_usual", "python_tuned", "python_usual"]

_BOOST = (
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)
"""Macros that Pinocchio's own CMake files define for its users."""

_TUNING = (
    "-fno-math-errno",
    "-DEIGEN_DONT_VECTORIZE",
    "-fno-tree-slp-vectorize",
    "-fno-semantic-interposition",
    "-fno-gnu-unique",
    "-fvisibility=hidden",
    "-finline-limit=2000",
    *("--param", "inline-unit-growth=400"),
    *("--param", "max-inline-insns-auto=400"),
    *("--param", "large-function-growth=1000"),
)
"""Its best flags here, 2.6 times as fast as plain -O3 -march=native: three-vectors that are written
one by one and read as a pair stall, and its small functions are inlined only when pressed."""


def python_tuned(robot: pteron.Manipulator) -> Calls:
    """Return the peer that calls `pinocchio.rnea` between two calls of compiled closed form."""
    carried = robot.platform.turns
    pin, model = _model(robot, carried)
    data = model.createData()
    closure = closed_form(robot, carried)
    joints = compiled_closure.joints(closure, unbounded=True)
    forces = compiled_closure.forces(closure)
    rnea = pin.rnea

    def call(pose: Array, velocity: Array, acceleration: Array) -> Array:
        q, v, a, rows = joints(pose, velocity, acceleration)
        return forces(rnea(model, data, q, v, a), rows)

    return Calls(call)


def python_usual(robot: pteron.Manipulator) -> Calls:
    """Return the peer that calls `pinocchio.rnea` as its manual does, and projects with NumPy.

    The inverse kinematics before it is compiled and in closed form; q, v, a and dq/dx come from it.
    """
    pin, model = _model(robot)
    data = model.createData()
    joints = compiled_closure.joints_and_rates(closed_form(robot), unbounded=True)
    first = 2 if robot.platform.planar else 3
    driven = 2 if robot.legs[0].type == "UPS" else 0
    actuated = slice(driven, first * len(robot.legs), first)

    def call(pose: Array, velocity: Array, acceleration: Array) -> Array:
        q, v, a, rates = joints(pose, velocity, acceleration)
        tau = pin.rnea(model, data, q, v, a)
        return np.linalg.solve(rates[actuated].T, rates.T @ tau)

    return Calls(call)


def _model(robot: pteron.Manipulator, carried: bool = True) -> tuple[Any, Any]:
    """Return the module pinocchio and the tree in it."""
    if find_spec("pinocchio") is None:
        raise Missing("the package pin is not installed")
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    ids: list[int] = []
    turns = {"z": pin.JointModelRUBZ, "y": pin.JointModelRUBY, "free": pin.JointModelFreeFlyer}
    for n, body in enumerate(tree(robot, carried)):
        joint = 0 if body.parent < 0 else ids[body.parent]
        place = pin.SE3(body.rotation, body.offset)
        slides = body.slides
        if len(slides) == 3:
            resting, slides = pin.SE3.Identity(), ()
            joint = model.addJoint(joint, pin.JointModelTranslation(), resting, f"p{n}")
        for axis in slides:
            kinds = [pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ]
            aligned = [
                kind() for kind, unit in zip(kinds, np.eye(3), strict=True) if all(axis == unit)
            ]
            kind = aligned[0] if aligned else pin.JointModelPrismaticUnaligned(axis)
            joint = model.addJoint(joint, kind, place, f"p{len(model.names)}")
            place = pin.SE3.Identity()
        for letter in _hinges(body):
            joint = model.addJoint(joint, turns[letter](), place, f"{letter}{n}")
            place = pin.SE3.Identity()
        inertia = pin.Inertia(body.mass, body.center, np.diag(body.inertia))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        ids.append(joint)
    return pin, model


def cpp_tuned(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls `pinocchio::rnea` in C++, with its best flags and best tree."""
    return _cpp(robot, _TUNING, carried=robot.platform.turns)


def cpp_usual(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls `pinocchio::rnea` in C++, with -O3 -march=native -DNDEBUG."""
    return _cpp(robot, (), carried=True)


def cpp_plain(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that calls `pinocchio::rnea` in C++, with -O3 -DNDEBUG for any processor."""
    return _cpp(robot, ("-march=x86-64", "-mtune=generic"), carried=True)


def c_generated(robot: pteron.Manipulator) -> Sweep:
    """Return the peer that is C code, printed by CasADi of `pinocchio::rnea` and what is around it.

    Pteron's passes simplify the whole, as they do its own.
    """
    if find_spec("casadi") is None or find_spec("pinocchio") is None:
        raise Missing("the package casadi or pin is not installed")
    folder = Path(ca.__file__).parent
    closure = closed_form(robot, robot.platform.turns)
    options = ["-std=c++17", "-O1", "-DSYMBOLIC", *_BOOST, *_includes()]
    options += ["-I", str(folder / "include"), f"-L{folder}", "-lcasadi", f"-Wl,-rpath,{folder}"]
    library = compiled("g++", "pinocchio_peer.cpp", options, version("pin"), "")
    joints, gravity = _table(tree(robot, robot.platform.turns)), np.array(robot.gravity)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "rnea.casadi"
        pointers = c_void_p(joints.ctypes.data), c_int(len(joints)), c_void_p(gravity.ctypes.data)
        if library.save(*pointers, c_char_p(bytes(path))):
            raise Missing("Pinocchio does not take the tree with CasADi's numbers")
        rnea = ca.Function.load(str(path))
    motion = closure.joints(unbounded=True).sx_in()
    *moved, rows = closure.joints(unbounded=True).call(motion)
    found = closure.forces().call([rnea(*moved), rows])
    whole = optimise_function(ca.Function("inverse", motion, ca.cse(found)))
    text = printed([whole]) + f"\nenum {{ M = {len(robot.legs)} }};\n"
    return Sweep(compiled("gcc", "generated_peer.c", ["-lm"], version("casadi"), text))


def _cpp(robot: pteron.Manipulator, flags: tuple[str, ...], carried: bool) -> Sweep:
    joints = _table(tree(robot, carried))
    gravity = np.array(robot.gravity)
    header, numbers = closed_form(robot, carried).in_c(unbounded=True)
    options = ["-std=c++17", *flags, *_BOOST, *_includes()]
    library = compiled("g++", "pinocchio_peer.cpp", options, version("pin"), header)
    return Sweep(
        library,
        c_void_p(joints.ctypes.data),
        c_int(len(joints)),
        c_void_p(gravity.ctypes.data),
        c_void_p(numbers.ctypes.data),
    )


def _hinges(body: Body) -> list[str]:
    return ["free"] if body.hinges == "free" else list(body.hinges)


def _includes() -> list[str]:
    """Return the options for the headers that the wheels bring; CasADi's brings Eigen's."""
    cmeel, casadi = find_spec("cmeel"), find_spec("casadi")
    folders: list[Path] = []
    if cmeel is not None and cmeel.origin is not None:
        prefix = Path(cmeel.origin).parent.with_name("cmeel.prefix") / "include"
        folders += [prefix, prefix / "eigen3"]
    if casadi is not None and casadi.origin is not None:
        folders.append(Path(casadi.origin).parent / "include" / "eigen3")
    wanted = {
        "pinocchio/algorithm/rnea.hpp": "pin",
        "boost/variant.hpp": "cmeel-boost",
        "Eigen/Core": "casadi (or cmeel-eigen)",
    }
    for header, package in wanted.items():
        if not any((folder / header).is_file() for folder in folders):
            raise Missing(f"no header {header}, which the package {package} brings")
    return [option for folder in folders for option in ("-isystem", str(folder))]


def _table(bodies: list[Body]) -> Array:
    """Return the joints, one a row, as `Joint` in pinocchio_peer.cpp has them."""
    slide, translation, turn = 0.0, 2.0, {"z": 1.0, "y": 3.0, "free": 4.0}
    nothing, identity = np.zeros(7), np.eye(3).ravel()
    table: list[Array] = []
    ids: list[float] = []
    for body in bodies:
        parent = 0.0 if body.parent < 0 else ids[body.parent]
        place = np.array([*body.rotation.ravel(), *body.offset])
        resting = np.array([*identity, 0.0, 0.0, 0.0])
        slides = body.slides
        if len(slides) == 3:
            table.append(np.array([translation, parent, *resting, 0.0, 0.0, 0.0, *nothing]))
            parent, slides = float(len(table)), ()
        for axis in slides:
            table.append(np.array([slide, parent, *place, *axis, *nothing]))
            parent, place = float(len(table)), resting
        for letter in _hinges(body):
            table.append(np.array([turn[letter], parent, *place, 0.0, 0.0, 1.0, *nothing]))
            parent, place = float(len(table)), resting
        table[-1][-7:] = [body.mass, *body.center, *body.inertia]
        ids.append(parent)
    return np.ascontiguousarray(table)

"""The exported C of a controller, compiled into the loop: the bits that it has by itself."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from itertools import product

import casadi as ca
import mechanisms
import numpy as np
import pytest
from claimed_machines import IN_THE_LOOP

import pteron
from pteron.controllers import (
    Adaptive,
    ComputedTorque,
    Custom,
    FeedForwardPD,
    PDGravity,
    joint_masses,
)
from pteron.legs import Elastic
from pteron.motion import Exported, Sensors, pick_and_place, simulate
from pteron.workspace import home_pose

COMPILER = shutil.which("cc") or shutil.which("gcc")
pytestmark = pytest.mark.skipif(not COMPILER, reason="there is no C compiler")


def driven(name):
    robot = pteron.load(name)
    drive = pteron.legs.Drive(coulomb=2.0, viscous=4.0, rotor_inertia=0.05)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


GIVEN = {"sensors": Sensors(1e-6), "delay": 5e-4, "duration": 0.05}


LAWS = {
    one.law_name: one
    for one in (PDGravity(), FeedForwardPD(), ComputedTorque(), Adaptive(friction=True))
}


@pytest.mark.parametrize(
    ("name", "law"),
    mechanisms.several(
        list(product(IN_THE_LOOP, LAWS)),
        [("five-bar", "computed_torque")],
    ),
)
def test_exported_c_in_the_loop_is_the_loops_own_controller_to_the_bit(name, law, tmp_path):
    controller = LAWS[law]
    robot = driven(name)
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    pteron.export_c(robot, [controller], tmp_path)
    own = simulate(robot, motion, controller, **GIVEN)
    linked = simulate(robot, motion, Exported(tmp_path, controller), **GIVEN)
    assert linked.stopped is None
    assert linked.velocity.any()
    for part in ("pose", "velocity", "forces", "asked", "memory"):
        np.testing.assert_array_equal(getattr(linked, part), getattr(own, part))


@mechanisms.CLIENTS
@pytest.mark.parametrize(
    "name", mechanisms.gated(["quadrupteron", "five-bar", "stewart"], ["five-bar"])
)
def test_drives_that_count_otherwise_run_the_machine_alike(name, tmp_path):
    """What the C takes and gives is per reading: each reading's sign, scale and zero are undone."""
    robot, controller = driven(name), Adaptive(friction=True)
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    own = simulate(robot, motion, controller, **GIVEN)
    counts = [pteron.legs.Reading(0.1 + 0.2 * i, (-1.7) ** i) for i in range(robot.joint_count)]
    legs = zip(robot.legs, counts, strict=True)
    other = replace(robot, legs=tuple(replace(leg, reading=count) for leg, count in legs))
    pteron.export_c(other, [controller], tmp_path)
    linked = simulate(other, motion, Exported(tmp_path, controller), **GIVEN)
    for part in ("pose", "velocity", "forces", "asked", "memory"):
        expected = getattr(own, part)
        off = np.abs(getattr(linked, part) - expected).max()
        assert off <= 1e-7 * np.abs(expected).max()  # encoders' steps leave rounding as it is


@mechanisms.CLIENTS
def test_exported_c_in_the_loop_is_what_it_is_by_itself(tmp_path):
    """Compiled alone, with other options, and called back at each sample."""
    robot, controller = driven("quadrupteron"), ComputedTorque()
    pteron.export_c(robot, [controller], tmp_path)
    library = tmp_path / "law.so"
    flags = ["-std=c99", "-O1", "-shared", "-fPIC", "-o", library, tmp_path / "quadrupteron.c"]
    subprocess.run([COMPILER, *flags, "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))

    class Alone:
        period = controller.period

        def law(self, model):
            self.memory = controller.law(model).memory
            return self

        def __call__(self, *sample):
            tables = [
                (ctypes.c_double * size).in_dll(loaded, f"quadrupteron_{name}")
                for name, size in (("computed_torque_gains", 9), ("parameters", 40), ("drives", 28))
            ]
            forces, memory = np.empty(4), np.empty(8)
            arrays = [np.ascontiguousarray(part, float) for part in sample]
            pointers = [ctypes.c_void_p(part.ctypes.data) for part in arrays]
            out = [ctypes.c_void_p(part.ctypes.data) for part in (forces, memory)]
            assert loaded.quadrupteron_computed_torque(*pointers, *tables, *out) == 0
            return forces, memory

    Alone.memory = None
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    linked = simulate(robot, motion, Exported(tmp_path, controller), **GIVEN)
    alone = simulate(robot, motion, Alone(), **GIVEN)
    for part in ("pose", "velocity", "forces", "asked", "memory"):
        np.testing.assert_array_equal(getattr(linked, part), getattr(alone, part))


def own_law(robot, *, motors=False):
    """Return a law with a memory, tables, comparisons, limits and a sine, as one might write it."""
    n, m = robot.joint_count, robot.freedom
    told = ("joints", "joint_rates", *(("motors", "motor_rates") if motors else ()))
    given = {name: ca.SX.sym(name, n) for name in told}
    wanted, total = ca.SX.sym("pose", m), ca.SX.sym("memory", n)
    gains, limit = ca.SX.sym("gains", n, 2), ca.SX.sym("limit")
    place = pteron.export.casadi_functions(robot)["inverse_kinematics"](wanted)
    error = ca.reshape(place, n, 1) - given["joints"]
    kept = ca.fmin(ca.fmax(total + error, -limit), limit)
    rates = given["motor_rates" if motors else "joint_rates"]
    forces = gains[:, 0] * error - gains[:, 1] * rates + ca.tanh(kept) + 0.01 * ca.sin(total)
    forces = ca.if_else(rates > 0.1, 0.9 * forces, forces)
    if motors:
        forces += 0.1 * gains[:, 0] * (given["joints"] - given["motors"])
    inputs = {"gains": gains, "memory": total, **given, "pose": wanted, "limit": limit}
    function = ca.Function("own_pid", [*inputs.values()], [kept, forces], [*inputs],
                           ["next_memory", "forces"])  # fmt: skip
    masses = joint_masses(robot)
    numbers = {"gains": np.array([3e3 * masses, 90.0 * masses]).T, "limit": 0.02}
    return Custom(function, parameters=numbers, memory=np.zeros(n))


@mechanisms.CLIENTS
@pytest.mark.parametrize(
    ("name", "elastic"),
    [
        *(("five-bar", None), ("five-bar", Elastic(50.0, 0.1, encoder="both"))),
        pytest.param("quadrupteron", None, marks=mechanisms.NIGHTLY),
        pytest.param("sprint-z3", Elastic(5e4, 50.0, encoder="motor"), marks=mechanisms.NIGHTLY),
    ],
)
def test_a_law_of_ones_own_is_exported_and_linked(name, elastic, tmp_path):
    robot = pteron.load(name)
    masses = joint_masses(robot)
    drives = [
        pteron.legs.Drive(0.1 * mass, mass, rotor_inertia=0.1 * mass, elastic=elastic)
        for mass in masses
    ]
    counts = [pteron.legs.Reading(0.1, 2.0 - 3.0 * (i % 2)) for i in range(len(masses))]
    legs = zip(robot.legs, drives, counts, strict=True)
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive, _ in legs))
    controller = own_law(robot, motors=elastic is not None)
    motion = pick_and_place(robot, home_pose(robot), least=0.05)
    own = simulate(robot, motion, controller, limits=False, **GIVEN)
    assert own.velocity.any()
    files = pteron.export_c(robot, [controller], tmp_path / "c")
    linked = simulate(robot, motion, Exported(tmp_path / "c", controller), limits=False, **GIVEN)
    assert linked.stopped is None
    for part in ("pose", "velocity", "forces", "asked", "memory"):
        np.testing.assert_array_equal(getattr(linked, part), getattr(own, part))
    # Its test program compares with the library.
    sources = [path for path in files if path.suffix == ".c"]
    program = tmp_path / "tests"
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([COMPILER, *flags, "-o", program, *sources, "-lm"], check=True)
    assert subprocess.run([program], check=False).returncode == 0
    # What drives count otherwise is undone.
    pairs = zip(robot.legs, counts, strict=True)
    other = replace(robot, legs=tuple(replace(leg, reading=count) for leg, count in pairs))
    pteron.export_c(other, [controller], tmp_path / "other")
    read = Exported(tmp_path / "other", controller)
    found = simulate(other, motion, read, limits=False, **GIVEN)
    assert np.abs(found.asked - own.asked).max() < 1e-7 * np.abs(own.asked).max()


def test_mistakes_of_laws_of_ones_own_are_told(tmp_path):
    joints = ca.SX.sym("joints", 3)

    def named(name, size=3):
        return Custom(ca.Function(name, [joints[:size]], [-joints[:size]], ["joints"], ["forces"]))

    with pytest.raises(pteron.ModelError, match="'jacobian' is the name of a function of pteron"):
        pteron.export_c("tripteron", named("jacobian"), tmp_path)
    with pytest.raises(pteron.DataError, match="joints: 3 numbers, 4 expected"):
        pteron.export_c("quadrupteron", [named("spring")], tmp_path)
    with pytest.raises(pteron.ModelError, match="spring, a Custom controller, can be exported as"):
        pteron.export_st("tripteron", [named("spring")], tmp_path)
    files = pteron.export_c("tripteron", named("spring"), tmp_path, specialised=True)
    assert "tripteron_spring(" in files[0].read_text() + files[1].read_text()
    linked, start = Exported(tmp_path, named("spring")), ([0.0, 0.0, 0.0],) * 2
    own = simulate("tripteron", None, named("spring"), start=start, duration=0.01)
    found = simulate("tripteron", None, linked, start=start, duration=0.01)
    np.testing.assert_array_equal(found.pose, own.pose)
    with pytest.raises(pteron.DataError, match="no C of damper there"):
        Exported(tmp_path, named("damper"))


def test_mistakes_are_told(tmp_path):
    with pytest.raises(pteron.DataError, match=r"no C of computed_torque there; write it with"):
        Exported(tmp_path, ComputedTorque())
    pteron.export_c("delta", [ComputedTorque()], tmp_path / "single", real="float")
    with pytest.raises(pteron.DataError, match="numbers of single precision"):
        Exported(tmp_path / "single", ComputedTorque())
    geared = replace(driven("delta"), name="geared")
    drive = pteron.legs.Drive(rotor_inertia=1e-5, ratio=10.0)
    geared = replace(geared, legs=tuple(replace(leg, drive=drive) for leg in geared.legs))
    pteron.export_c(geared, [ComputedTorque()], tmp_path / "motors", output="torque")
    with pytest.raises(pteron.DataError, match="gives commands of the motors; export with output"):
        Exported(tmp_path / "motors", ComputedTorque())
    for law in (ComputedTorque, FeedForwardPD, Adaptive):
        pteron.export_c("five-bar", [law(period=1e-3)], tmp_path / law.__name__)
        assert Exported(tmp_path / law.__name__, law(period=1e-3)).law("five-bar").linked
        with pytest.raises(pteron.DataError, match=r"_gains is for a period of 0.001 s, the con"):
            Exported(tmp_path / law.__name__, law(period=4e-3)).law("five-bar")
    pteron.export_c("delta", [ComputedTorque()], tmp_path)
    with pytest.raises(pteron.DataError, match="no C of feed_forward_pd there"):
        Exported(tmp_path, FeedForwardPD())
    with pytest.raises(pteron.DataError, match="export the controller for this machine"):
        Exported(tmp_path, ComputedTorque()).law("quadrupteron")
    with pytest.raises(pteron.DataError, match=r"controller: .* one of pteron.controllers"):
        Exported(tmp_path, "pd")

"""The exported C of a controller, compiled into the loop: the bits that it has by itself."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from itertools import product

import mechanisms
import numpy as np
import pytest

import pteron
from pteron.controllers import Adaptive, ComputedTorque, FeedForwardPD, PDGravity
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
    one.what: one
    for one in (PDGravity(), FeedForwardPD(), ComputedTorque(), Adaptive(friction=True))
}


@pytest.mark.parametrize(
    ("name", "law"),
    mechanisms.several(
        list(product(("five-bar", "quadrupteron", "delta", "par4", "stewart", "3-rrr"), LAWS)),
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

"""The control loop's readings, and controllers of one's own: expressions and Structured Text."""

import os
import signal
import threading
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from mechanisms import CLIENTS
from structured_text import Block, read

import pteron
from pteron.controllers import ComputedTorque, Custom
from pteron.kernels.c import c_compiler
from pteron.legs import Elastic
from pteron.motion import Sensors, advance, machines_about, pick_and_place, simulate, simulate_many
from pteron.workspace import home_pose

N = 3
REST = np.zeros(N)


def driven(name, **drive):
    robot = pteron.load(name)
    drive = pteron.legs.Drive(**{"coulomb": 1.0, "viscous": 8.0, "rotor_inertia": 0.2} | drive)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


def symbols(*names):
    return [ca.SX.sym(name, N) for name in names]


def recording(*readings):
    """Return a controller that asks for no forces and remembers what it reads."""
    given = symbols(*readings)
    memory = ca.SX.sym("memory", N * len(given))
    function = ca.Function(
        *("recording", [*given, memory], [ca.SX.zeros(N), ca.vertcat(*given)]),
        *([*readings, "memory"], ["forces", "next_memory"]),
    )
    return Custom(function, memory=np.zeros(N * len(given)))


def integrating():
    """Return PID control of the joints, its integral bounded, and the same in Python."""
    wanted, joints, rates, total = symbols("pose", "joints", "joint_rates", "memory")
    gains = ca.SX.sym("gains", 3)
    solved = pteron.export.casadi_functions("tripteron")["inverse_kinematics"]
    error = solved(wanted) - joints
    kept = ca.fmin(ca.fmax(total + 1e-3 * error, -1e-3), 1e-3)
    forces = gains[0] * error - gains[1] * rates + gains[2] * ca.tanh(kept)
    function = ca.Function(
        *("pid", [wanted, joints, rates, total, gains], [forces, kept]),
        *(["pose", "joints", "joint_rates", "memory", "gains"], ["forces", "next_memory"]),
    )

    class Called:
        period = 1e-3

        def law(self, model):
            return self

        def memory(self, pose, velocity):
            return REST

        def __call__(self, pose, velocity, acceleration, joints, joint_rates, memory):
            error = pteron.inverse_kinematics("tripteron", pose) - joints
            kept = np.clip(memory + 1e-3 * error, -1e-3, 1e-3)
            return 4e3 * error - 90.0 * joint_rates + 8e3 * np.tanh(kept), kept

    return Custom(function, parameters={"gains": [4e3, 90.0, 8e3]}, memory=REST), Called()


@CLIENTS
def test_an_expression_is_the_controller_that_python_calls(monkeypatch):
    robot = driven("tripteron")
    motion = pick_and_place(robot, REST, least=0.1)
    expressed, called = integrating()
    given = {"sensors": Sensors(1e-6, cutoff=200.0), "duration": 0.1, "delay": 3e-4}
    slow = simulate(robot, motion, expressed, **given)
    back = simulate(robot, motion, called, **given)
    np.testing.assert_allclose(slow.asked, back.asked, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(slow.memory, back.memory, rtol=0.0, atol=1e-12)
    assert np.abs(slow.error).max() < 0.02
    monkeypatch.delenv("PTERON_KERNELS")
    fast = simulate(robot, motion, expressed, **given)
    for part in ("pose", "asked", "memory"):
        np.testing.assert_array_equal(getattr(fast, part), getattr(slow, part))
    many = simulate_many(machines_about(robot, 9), motion, expressed, **given)
    assert many.samples.tolist() == [101] * 9
    np.testing.assert_allclose(many.largest[8], np.abs(slow.error).max(axis=0), rtol=1e-9)


@pytest.mark.parametrize("late", [0.0, 3e-4, 6e-4])
def test_readings_are_as_old_as_is_said(late, monkeypatch):
    """Two samples and 0.4 ms, with commands that come before, at or after the sensors' look."""
    monkeypatch.delenv("PTERON_KERNELS")
    robot = driven("tripteron")
    start = REST, np.array([0.2, -0.1, 0.0])
    sensors = Sensors(delay=4e-4, samples=2)
    given = {"start": start, "duration": 0.03}
    found = simulate(
        robot, None, recording("joints", "joint_rates"), sensors=sensors, delay=late, **given
    )
    fine = simulate(robot, start=start, period=1e-4, duration=0.03)
    old = np.maximum(10 * np.arange(31) - 24, 0)
    told = np.hstack([fine.joints, fine.joint_rates])[old]
    np.testing.assert_allclose(found.memory, told, rtol=0.0, atol=1e-12)
    monkeypatch.setenv("PTERON_KERNELS", "vm")
    slow = simulate(
        robot, None, recording("joints", "joint_rates"), sensors=sensors, delay=late, **given
    )
    np.testing.assert_array_equal(slow.memory, found.memory)


def test_encoders_at_motors_joints_and_both():
    bends = [Elastic(2e4, 5.0, encoder=at) for at in ("motor", "joint", "both")]
    robot = driven("tripteron", coulomb=0.0)
    legs = zip(robot.legs, bends, strict=True)
    robot = replace(
        robot, legs=tuple(replace(g, drive=replace(g.drive, elastic=e)) for g, e in legs)
    )
    given = {"start": (REST, [0.1, 0.2, -0.1]), "duration": 0.02}
    names = ("joints", "joint_rates", "motors", "motor_rates")
    with pytest.raises(pteron.DataError, match=r"motors and motor_rates, which .* of leg 2 of tri"):
        simulate(robot, None, recording(*names), **given)
    third = replace(robot.legs[1], drive=replace(robot.legs[1].drive, elastic=bends[2]))
    robot = replace(robot, legs=(robot.legs[0], third, robot.legs[2]))
    found = simulate(robot, None, recording(*names), **given)
    joints, rates, motors, motor_rates = np.split(found.memory, 4, axis=1)
    np.testing.assert_array_equal(joints[:, 1:], found.joints[:, 1:])
    np.testing.assert_array_equal(joints[:, 0], motors[:, 0])
    np.testing.assert_array_equal(rates, motor_rates)
    assert 1e-5 < np.abs(motors - found.joints).max() < 1e-2
    assert np.abs(rates - found.joint_rates).max() > 1e-3
    # Encoders of their own steps.
    steps = Sensors(1e-4, motor_encoder=1e-6)
    told = simulate(robot, None, recording(*names), sensors=steps, **given).memory
    for part, width in ((told[:, 1:3], 1e-4), (told[:, 6:9], 1e-6)):
        np.testing.assert_allclose(part / width, np.round(part / width), atol=1e-6)
    assert np.abs(told[:, 6:9] / 1e-4 - np.round(told[:, 6:9] / 1e-4)).max() > 0.1


def test_what_no_sensor_gives_and_other_mistakes_are_told():
    joints, memory = symbols("q", "m")

    def made(expressions, inputs, outputs=("forces",), **more):
        given = {"joints": joints, "memory": memory}
        arguments = [given[n] if n in given else ca.SX.sym(n, N) for n in inputs]
        expressions = expressions or [joints * arguments[1]]
        return Custom(ca.Function("f", arguments, expressions, inputs, list(outputs)), **more)

    for wrong, message in (
        (lambda: made([], ["joints", "force"]), "force: no sensor gives it; there are"),
        (
            lambda: made([memory[:2]], ["memory", "wrench", "tilt"]),
            "wrench, tilt: no sensor",
        ),
        (lambda: made([joints], ["joints"], parameters={"a": 1.0}), "a: no input has that name"),
        (lambda: made([joints], ["joints"], ["torque"]), "outputs: torque given, forces expected"),
        (lambda: made([joints], ["joints", "memory"]), "forces, next_memory expected"),
        (lambda: made([ca.log(joints)], ["joints"]), "log cannot be C here; there are add"),
        (lambda: made([joints], ["joints"], period=2.0), "period: 2 s given"),
        (lambda: Custom("joints"), "function: 'joints' given, a casadi.Function"),
        (lambda: made([joints], ["joints"], parameters={"joints": REST}), "is a reading or the"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            wrong()
    start = {"duration": 0.01}
    at = home_pose("quadrupteron"), np.zeros(4)
    with pytest.raises(pteron.DataError, match="joints: 3 numbers, 4 expected"):
        simulate("quadrupteron", None, made([joints], ["joints"]), start=at, **start)
    for given, message in (
        ({"parameters": {"k": [1.0, 2.0]}}, "k: .* 3 finite numbers expected"),
        ({"parameters": {"k": [1.0, np.nan, 1.0]}}, "k: .* 3 finite numbers expected"),
    ):
        law = made([], ["joints", "k"], **given)
        with pytest.raises(pteron.DataError, match=message):
            simulate("tripteron", None, law, start=(REST, REST), **start)
    law = made([joints, memory], ["joints", "memory"], ["forces", "next_memory"], memory=[1.0])
    with pytest.raises(pteron.DataError, match=r"memory: .* 3 finite numbers expected"):
        simulate("tripteron", None, law, start=(REST, REST), **start)
    for given, message in (
        ({"delay": -1.0}, "delay: -1.0 given, 0 s or more"),
        ({"delay": [1.0, 2.0]}, "delay: .* given, 0 s or more"),
        ({"delay": None}, "delay: None given"),
        ({"samples": 1.5}, "samples: 1.5 given, a whole number"),
        ({"samples": True}, "samples: True given, a whole number"),
        ({"motor_encoder": -1.0}, "motor_encoder: -1.0 given"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            Sensors(**given)


class Text:
    """A controller's Structured Text, run as a strict controller would."""

    def __init__(self, robot, controller, folder):
        *_, path = pteron.export_st(robot, [controller], folder)
        self.block, self.period = Block(read(path.read_text(encoding="utf-8"))), controller.period
        self.own = controller.law(robot)
        self.numbers = {name: value.ravel() for name, value in self.own.numbers.items()}

    def law(self, model):
        return self

    def memory(self, pose, velocity):
        return self.own.memory(pose, velocity)

    def __call__(self, *sample):
        names = ("pose", "velocity", "acceleration", "joints", "joint_rates", "memory")
        given = dict(zip(names, sample, strict=True))
        given |= {name: self.numbers[f"law_{name}"] for name in ("gains", "parameters", "drives")
                  if name in self.block.names("VAR_INPUT")}  # fmt: skip
        found = self.block(**{k: dict(_places(value)) for k, value in given.items()})
        assert found["status"] == 0
        return [np.array([*found[name].values()]) for name in ("forces", "next_memory")]


def _places(values):
    return (((k,), float(value)) for k, value in enumerate(values))


def test_structured_text_closes_the_loop(tmp_path):
    robot, controller = driven("five-bar"), ComputedTorque()
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    given = {"sensors": Sensors(1e-6), "delay": 5e-4, "duration": 0.03}
    own = simulate(robot, motion, controller, **given)
    text = simulate(robot, motion, Text(robot, controller, tmp_path), **given)
    assert text.stopped is None
    assert text.velocity.any()
    np.testing.assert_allclose(text.pose, own.pose, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(text.asked, own.asked, rtol=1e-8, atol=1e-8)


@CLIENTS
@pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
@pytest.mark.skipif(os.name != "posix", reason="signals of another kind")
@pytest.mark.parametrize("what", ["simulate", "advance"])
def test_an_interrupt_ends_a_loop_that_would_run_for_minutes_or_years(what, monkeypatch):
    monkeypatch.delenv("PTERON_KERNELS", raising=False)
    robot, law = driven("tripteron"), ComputedTorque(period=1e-4)
    advance(robot, REST, REST, REST, 1e-6, 10)  # compiles
    simulate(robot, None, law, start=(REST, REST), duration=1e-3)
    main = threading.main_thread().ident
    timer = threading.Timer(1.0, signal.pthread_kill, (main, signal.SIGINT))
    timer.start()
    still = {"start": (REST, REST), "duration": 0.5, "step": 1e-8}
    run = {
        "advance": lambda: advance(robot, REST, REST, REST, 1e-15, 10**12),
        "simulate": lambda: simulate(robot, None, law, **still),
    }
    with pytest.raises(KeyboardInterrupt):
        run[what]()
    timer.cancel()

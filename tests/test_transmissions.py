"""Drives that bend, have play, lag and ripple: modes, impacts, limits, mistakes."""

import re
from dataclasses import replace

import mechanisms
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, null_space

import pteron
from pteron.controllers import ComputedTorque, FeedForwardPD
from pteron.legs import Elastic, LuGre, Wave, Winding
from pteron.manipulator import parameters
from pteron.motion import (
    Sensors,
    advance,
    longest_step,
    machines_about,
    modes,
    pick_and_place,
    simulate,
    simulate_many,
)
from pteron.workspace import home_pose

BENDS = pteron.legs.Drive(coulomb=2.0, viscous=5.0, rotor_inertia=0.2, elastic=Elastic(2e5, 30.0))


def driven(robot, *drives):
    drives = drives * robot.joint_count if len(drives) == 1 else drives
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))


@pytest.fixture
def mass():
    """Return a Tripteron of point masses, whose joints do not know of each other."""
    robot = pteron.load("tripteron")
    masses = [
        value if (data.kind, data.body) == ("m", "p") else 1e-9 * value
        for data, value in zip(
            pteron.manipulator.parameter_data(robot), parameters(robot), strict=True
        )
    ]
    return replace(pteron.with_parameters(robot, masses), gravity=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", mechanisms.gated(["quadrupteron", "delta", "par4"], ["delta"]))
def test_modes_are_those_of_the_tree_with_its_loops_closed(name):
    """MuJoCo's mass matrix of the tree, projected on what its closed loops leave."""
    mujoco = pytest.importorskip("mujoco")
    from pteron.export import coordinates, mjcf, tree

    robot = pteron.load(name)
    stiffness = np.linspace(1e5, 3e5, robot.joint_count)
    inertia = np.linspace(0.1, 0.3, robot.joint_count)
    drives = [
        pteron.legs.Drive(rotor_inertia=i, elastic=Elastic(k))
        for i, k in zip(inertia, stiffness, strict=True)
    ]
    soft, home = driven(robot, *drives), home_pose(robot)
    opened = tree(robot)
    model = mujoco.MjModel.from_xml_string(mjcf(opened))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:] = coordinates(opened, home[None])[0]
    mujoco.mj_forward(model, data)
    tree_mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, tree_mass)
    equal = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    free = null_space(data.efc_J.reshape(-1, model.nv)[equal], rcond=1e-9)
    assert free.shape[1] == robot.freedom
    names = [joint.name for joint in opened.joints]
    rows = free[[names.index(joint) for joint in robot.joint_names]]
    n = robot.joint_count
    mass = np.block(
        [[free.T @ tree_mass @ free, np.zeros((n, n))], [np.zeros((n, n)), np.diag(inertia)]]
    )
    bent = np.hstack([-rows, np.eye(n)])
    expected = np.sqrt(np.clip(eigh(bent.T @ np.diag(stiffness) @ bent, mass)[0], 0.0, None))[n:]
    rates, stretch = modes(soft, home)
    found = np.sort(rates.imag[rates.imag > 1.0])
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert stretch.shape == (n, 4 * n)
    assert longest_step(soft, home) == pytest.approx(2.0 / found[-1], rel=1e-6)


def test_the_loop_vibrates_as_its_modes_do(mass):
    soft = driven(mass, pteron.legs.Drive(rotor_inertia=0.3, elastic=Elastic(3e4, 2.0)))
    start = np.zeros(3), np.array([0.1, 0.0, 0.0])
    found = simulate(soft, start=start, duration=0.1)
    # Motors begin as fast as their joints; then it is the platform that is thrown on.
    np.testing.assert_allclose(found.velocity[:, 0], 0.1, atol=1e-9)
    pushed = simulate(soft, start=(np.zeros(3), np.zeros(3)), forces=[3.0, 0.0, 0.0], duration=0.1)
    load, rotor, k, c = pteron.mass_matrix(soft, np.zeros(3))[0, 0], 0.3, 3e4, 2.0

    def rates(_, y):
        spring = k * (y[2] - y[0]) + c * (y[3] - y[1])
        return [y[1], spring / load, y[3], (3.0 - spring) / rotor]

    exact = solve_ivp(rates, (0, 0.1), np.zeros(4), "DOP853", pushed.time, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(pushed.pose[:, 0], exact.y[0], rtol=0.0, atol=2e-10)


def test_backlash_is_that_of_an_event_driven_solution(mass):
    """Contact, play and contact again, each solved by itself up to where it ends."""
    gap, k, c, rotor = 2e-4, 3e4, 5.0, 0.3
    bends = Elastic(k, c, backlash=gap)
    soft = driven(mass, pteron.legs.Drive(rotor_inertia=rotor, elastic=bends))
    load = pteron.mass_matrix(soft, np.zeros(3))[0, 0]

    def force(t):
        return 20.0 * np.sin(90.0 * t)

    def spring(y, side):
        return 0.0 if side == 0 else k * (y[2] - y[0] - side * gap / 2) + c * (y[3] - y[1])

    def rates(held, side):
        return lambda t, y: [
            *(y[1], spring(y, side) / load),
            *(y[3], (held - spring(y, side)) / rotor),
        ]

    def events(side):
        def at(edge):
            return lambda t, y: y[2] - y[0] - edge * gap / 2

        def parts(t, y):
            return side * spring(y, side)

        found = [at(1), at(-1)] if side == 0 else [parts]
        for event, way in zip(found, (1, -1) if side == 0 else (-1,), strict=True):
            event.terminal, event.direction = True, way
        return found

    period, state, side, exact, changes = 1e-3, np.zeros(4), 0, [np.zeros(4)], 0
    for sample in range(80):
        held, now, end = force(sample * period), sample * period, (sample + 1) * period
        while end - now > 1e-13:
            part = solve_ivp(
                rates(held, side), (now, end), state, "DOP853", events=events(side),
                rtol=1e-11, atol=1e-14,
            )  # fmt: skip
            state, now = part.y[:, -1], part.t[-1]
            if part.status == 1:
                changes += 1
                edge = 1 if len(part.t_events[0]) else -1
                side = edge if side == 0 else 0
        exact.append(state)
    exact = np.array(exact)
    assert changes > 4
    off = []
    for step in (1e-4, 2.5e-5):
        found = simulate(
            soft, start=(np.zeros(3), np.zeros(3)), duration=0.08, step=step,
            forces=lambda t: np.array([force(t), 0.0, 0.0]),
        )  # fmt: skip
        off.append(np.abs(found.pose[:, 0] - exact[:, 0]).max() / np.abs(exact[:, 0]).max())
    assert off[1] < 1e-4
    assert off[1] < 0.5 * off[0]


def test_a_motor_gives_what_its_curve_winding_and_current_allow(mass):
    def moved(*, forces, duration=0.02, **drive):
        robot = driven(mass, pteron.legs.Drive(rotor_inertia=0.01, ratio=1.0, **drive), *2 * [None])
        rest = np.zeros(3)
        return robot, simulate(
            robot, start=(rest, rest), forces=[forces, 0.0, 0.0], duration=duration
        )

    load = pteron.mass_matrix(mass, np.zeros(3))[0, 0] + 0.01
    _, first = moved(forces=5.0, current_time=5e-3)
    lag = 5e-3
    exact = 5.0 / load * (first.time - lag * -np.expm1(-first.time / lag))
    np.testing.assert_allclose(first.velocity[:, 0], exact, rtol=0.0, atol=1e-3 * exact[-1] + 2e-2)
    _, limited = moved(forces=1e3, curve=((0.0, 10.0), (0.2, 10.0), (0.5, 0.0)), duration=0.5)
    assert limited.acceleration[0, 0] == pytest.approx(10.0 / load, rel=1e-6)
    assert limited.velocity[-1, 0] == pytest.approx(0.5, rel=1e-3)
    winding = Winding(resistance=2.0, torque_constant=4.0, voltage=6.0)
    _, supplied = moved(forces=1e3, winding=winding, duration=0.2)
    assert supplied.acceleration[0, 0] == pytest.approx(12.0 / load, rel=1e-6)
    rate = 16.0 / 2.0 / load
    expected = 1.5 * -np.expm1(-rate * supplied.time)
    np.testing.assert_allclose(supplied.velocity[:, 0], expected, rtol=0.0, atol=1e-9)


def test_forces_are_what_motors_give_and_not_what_is_asked_of_them():
    """Of one motor with a curve, one with a winding, one that bends and one that may do all."""
    drawn, free = pteron.load("quadrupteron"), pteron.legs.Drive(rotor_inertia=1e-5, ratio=300.0)
    curve = (0.0, 20.0), (0.1, 20.0), (0.5, 0.0)
    limited = replace(free, curve=curve)
    drives = [
        *(limited, replace(free, winding=Winding(2.0, 0.1, 2.0))),
        *(replace(limited, elastic=Elastic(3e5, 50.0)), free),
    ]
    robot = driven(drawn, *drives)
    motion = pick_and_place(drawn, home_pose(drawn), least=0.1)
    given = {"duration": 0.16, "model": drawn}
    found = simulate(robot, motion, ComputedTorque(), limits=False, **given)
    most = np.interp(np.abs(found.motor_rates[:, 2]), *np.array(curve).T)
    assert (np.abs(found.forces[:, 2]) <= most + 1e-12).all()
    assert (found.saturated_share[:3] > 0.2).all()
    assert found.saturated_share[3] == 0.0
    stiff = driven(drawn, *drives[:2], limited, free)
    found = simulate(stiff, motion, ComputedTorque(), limits=False, **given)
    own = pteron.drive_forces(stiff, found.pose, found.velocity, found.acceleration)
    np.testing.assert_allclose(found.forces, own, rtol=0.0, atol=1e-8 * np.abs(own).max())
    assert np.abs(found.asked[:, :3]).max() > 1.5 * np.abs(own[:, :3]).max()
    many = machines_about(robot, 2)
    alone = simulate(robot, motion, ComputedTorque(), limits=False, **given)
    batch = simulate_many(many, motion, ComputedTorque(), **given)
    np.testing.assert_allclose(batch.force[1], np.abs(alone.forces).max(axis=0), rtol=1e-9)


@pytest.mark.parametrize("name", mechanisms.gated(["quadrupteron", "3-rpr", "ankle"], ["3-rpr"]))
def test_forces_of_currents_that_lag_are_what_acts_and_not_what_is_asked(name):
    """One joint bends and has bristles too, one has a current at once; of it all is asked."""
    drawn = pteron.load(name)
    home, rest = home_pose(drawn), np.zeros(drawn.freedom)
    lags = pteron.legs.Drive(rotor_inertia=0.01, current_time=5e-3)
    soft = replace(lags, elastic=Elastic(4e3, 4.0), coulomb=0.1, lugre=LuGre(1e3, 1.0))
    at_once = replace(lags, current_time=None)
    robot = driven(drawn, soft, *[lags] * (drawn.joint_count - 2), at_once)
    held = pteron.inverse_dynamics(drawn, home, rest, rest)
    asked = held + 0.3 * np.abs(held).max() * np.linspace(1.0, -0.5, len(held))
    found = simulate(robot, start=(home, rest), forces=asked, duration=0.02)
    assert found.stopped is None
    grown = asked + (held - asked) * np.exp(-found.time / 5e-3)[:, None]
    grown[:, -1] = asked[-1]
    np.testing.assert_allclose(found.forces, grown, rtol=0.0, atol=1e-7 * np.abs(asked).max())
    own = pteron.drive_forces(robot, found.pose, found.velocity, found.acceleration)
    stiff = slice(1, None)
    np.testing.assert_allclose(
        found.forces[:, stiff], own[:, stiff], rtol=0.0, atol=1e-8 * np.abs(own).max()
    )
    np.testing.assert_array_equal(found.table()[robot.force_names[0]], found.forces[:, 0])
    many, motion = machines_about(robot, 2), pick_and_place(drawn, home, scale=0.02, duration=0.5)
    law, how = FeedForwardPD(bandwidth=20.0), {"duration": 0.02, "model": drawn}
    alone, batch = simulate(robot, motion, law, **how), simulate_many(many, motion, law, **how)
    np.testing.assert_allclose(batch.force[1], np.abs(alone.forces).max(axis=0), rtol=1e-9)


def test_ripple_and_cogging_come_by_the_motors_angle(mass):
    drive = pteron.legs.Drive(
        rotor_inertia=1e-6, ratio=200.0, ripple=(Wave(6, 0.05, 0.3),), cogging=(Wave(4, 0.02),)
    )
    robot = driven(mass, drive, *2 * [None])
    rest = np.zeros(3)
    found = simulate(robot, start=(rest, rest), forces=[8.0, 0.0, 0.0], duration=0.3)
    angle = 200.0 * found.joints[:, 0]
    force = 8.0 * (1.0 + 0.05 * np.sin(6 * angle + 0.3)) + 200.0 * 0.02 * np.sin(4 * angle)
    load = pteron.mass_matrix(robot, rest)[0, 0] + drive.inertia
    np.testing.assert_allclose(found.acceleration[:, 0], force / load, rtol=0.0, atol=1e-6)
    assert np.ptp(found.acceleration[:, 0]) > 5.0


@mechanisms.CLIENTS
@pytest.mark.parametrize("encoder", ["motor", "joint"])
def test_a_machine_with_soft_drives_follows_its_cycle_alike_in_c_and_numpy(encoder, monkeypatch):
    robot = pteron.load("quadrupteron")
    bends = replace(
        BENDS, elastic=Elastic(3e5, 60.0, 2e-6, encoder), current_time=2e-4, ratio=300.0,
        rotor_inertia=0.2 / 300.0**2, cogging=(Wave(4, 1e-4),), lugre=LuGre(2e4, 20.0),
    )  # fmt: skip
    robot = driven(robot, bends, *2 * [BENDS], replace(BENDS, elastic=None))
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    given = {"sensors": Sensors(1e-6), "duration": 0.01, "model": pteron.load("quadrupteron")}
    slow = simulate(robot, motion, FeedForwardPD(bandwidth=40.0), **given)
    monkeypatch.delenv("PTERON_KERNELS")
    fast = simulate(robot, motion, FeedForwardPD(bandwidth=40.0), **given)
    assert fast.stopped is None
    for part in ("pose", "velocity", "acceleration", "joints", "forces", "memory"):
        np.testing.assert_array_equal(getattr(fast, part), getattr(slow, part))
    assert np.abs(fast.error).max() < 1e-2


@pytest.mark.parametrize("encoder", ["motor", "joint"])
def test_motors_lead_by_what_the_load_bends_and_a_log_has_what_encoders_tell(encoder):
    robot = pteron.load("delta")
    bends = Elastic(2e4, damping=40.0, backlash=1e-3, encoder=encoder)
    soft = pteron.legs.Drive(rotor_inertia=0.05, elastic=bends)
    machine = replace(robot, legs=(replace(robot.legs[0], drive=soft), *robot.legs[1:]))
    start = np.array([0.0, 0.0, -1.0]), np.zeros(3)
    held = pteron.inverse_dynamics(robot, *start, np.zeros(3))
    found = simulate(machine, start=start, forces=held, duration=0.05)
    lead = found.motors - found.joints
    np.testing.assert_allclose(lead[:, 0], held[0] / 2e4 + 0.5e-3, rtol=1e-6)
    np.testing.assert_array_equal(lead[:, 1:], 0.0)
    log = found.table()
    told = found.motors if encoder == "motor" else found.joints
    np.testing.assert_array_equal(log["theta1"], told[:, 0])
    np.testing.assert_array_equal(log["motor_theta1"], found.motors[:, 0])


@pytest.mark.parametrize("lag", [None, 5e-4])
def test_states_of_soft_drives_go_on_from_call_to_call(lag):
    robot = driven(pteron.load("delta"), replace(BENDS, coulomb=0.5, current_time=lag))
    pose = pteron.random_poses(robot, 3, seed=1, type_i=0.3, type_ii=0.2)
    forces = 2.0 * np.random.default_rng(1).normal(size=pose.shape)
    velocity, drives = np.zeros_like(pose), None
    whole = advance(robot, pose, velocity, forces, 5e-5, 40)
    for _ in range(4):
        pose, velocity, drives, going = advance(
            robot, pose, velocity, forces, 5e-5, 10, drives=drives
        )
        assert going.all()
    assert drives.shape == (3, 6 if lag is None else 9)
    for one, other in zip(whole, (pose, velocity, drives), strict=False):
        np.testing.assert_array_equal(one, other)


def test_mistakes_are_told():
    robot, rest = pteron.load("tripteron"), np.zeros(3)
    stiff = driven(robot, *2 * [BENDS], replace(BENDS, elastic=Elastic(2e9)))
    told = {
        "leg 3: the stiffness of its transmission asks for 1.*e-05 s at most": {"step": 5e-5},
        'the drives of tripteron bend, lag or ripple; "rk4" has them': {"method": "dop853"},
    }
    for message, given in told.items():
        with pytest.raises(pteron.DataError, match=message):
            simulate(stiff, start=(rest, rest), duration=0.01, **given)
    assert simulate(stiff, start=(rest, rest), duration=0.002).step < 2e-5
    with pytest.raises(pteron.DataError, match="drives: shape"):
        advance(stiff, rest, rest, rest, 1e-5, 1, drives=rest)
    slow = driven(robot, replace(BENDS, elastic=None, current_time=1e-5))
    with pytest.raises(pteron.DataError, match="leg 1: the current's time constant asks for 2e-05"):
        simulate(slow, start=(rest, rest), duration=0.01, step=5e-5)
    for wrong, message in (
        ({"elastic": "soft", "curve": 5}, "2 faults"),
        (
            {"coulomb": -1.0, "curve": ((1.0, -2.0), (0.5, 3.0)), "elastic": Elastic(1e5)},
            r"(?s)4 faults.*coulomb: -1 given.*elastic: needs rotor.*ascending.*of 0 or more",
        ),
        ({"curve": ((0.0, np.nan),)}, "curve: .* pairs of numbers, speed and force, expected"),
        ({"ripple": (3,)}, "ripple: .* a list of Wave expected"),
        ({"lugre": {"stiffness": 1.0}}, "lugre: .* a LuGre expected"),
        ({"elastic": Elastic(1e5)}, "elastic: needs rotor_inertia"),
        ({"cogging": (Wave(4, 1.0),)}, "cogging: needs ratio"),
        ({"curve": ((1.0, 2.0), (0.5, 3.0))}, "curve: speeds from 0 up expected"),
        ({"curve": ((0.0, 2.0),), "max_force": 5.0}, "max_force: 5 given, but the curve has 2"),
    ):
        with pytest.raises(pteron.ModelError, match=message):
            pteron.legs.Drive(**wrong)
    with pytest.raises(pteron.ModelError, match="stiffness: -1 given"):
        Elastic(-1.0)
    with pytest.raises(
        pteron.ModelError, match='encoder: \'load\' given, "motor", "joint" or "both"'
    ):
        Elastic(1.0, encoder="load")


@pytest.mark.parametrize("stiffness", [1.7e5, 2.3e5, 3.1e6])
def test_a_step_that_is_told_is_taken(stiffness):
    given = {"start": (np.zeros(3), np.zeros(3)), "duration": 0.01, "period": 0.01}
    robot = driven(pteron.load("tripteron"), replace(BENDS, elastic=Elastic(stiffness)))
    with pytest.raises(pteron.DataError, match="at most") as told:
        simulate(robot, **given, step=0.009)
    longest = float(re.search(r"asks for (\S+) s at most", str(told.value))[1])
    found = simulate(robot, **given, step=longest)
    assert found.step == longest > 0.9 * longest_step(robot, np.zeros(3))


def test_a_winding_at_its_supplys_limit_asks_for_short_steps(mass):
    """Its force falls by (k ratio)^2 / R for each m/s: a light joint comes to its speed at once."""
    winding = Winding(resistance=0.1, torque_constant=1.0, voltage=6.0)
    drive = pteron.legs.Drive(ratio=100.0, rotor_inertia=1e-9, winding=winding)
    robot, rest = driven(mass, drive), np.zeros(3)
    found = simulate(robot, start=(rest, rest), forces=[1e4, 0.0, 0.0], duration=0.01)
    load = pteron.mass_matrix(robot, rest)[0, 0] + drive.inertia
    assert found.step == pytest.approx(2.0 * load / 1e5, rel=0.2)
    # What holds as the supply is at its limit: 0.06 m/s, without load, in microseconds.
    np.testing.assert_allclose(found.velocity[2:, 0], 0.06, rtol=1e-6)


def test_a_file_keeps_all_of_a_drive(tmp_path):
    drive = replace(
        BENDS, ratio=100.0, current_time=2e-4, curve=((0.0, 10.0), (1.0, 5.0)),
        winding=Winding(0.5, 0.1, 48.0), ripple=(Wave(6, 0.02),), cogging=(Wave(42, 0.005, 0.1),),
        lugre=LuGre(1e6, 3.0),
    )  # fmt: skip
    robot = driven(pteron.load("five-bar"), drive)
    pteron.save(robot, tmp_path / "robot.toml")
    assert pteron.load(tmp_path / "robot.toml") == robot
    text = (tmp_path / "robot.toml").read_text().replace("stiffness", "stifness", 1)
    (tmp_path / "robot.toml").write_text(text)
    with pytest.raises(pteron.ModelError, match="stifness"):
        pteron.load(tmp_path / "robot.toml")

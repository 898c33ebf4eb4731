"""Dry friction that sticks: rest to the last bit, stick-slip, energy, MuJoCo, orders."""

from dataclasses import replace

import mechanisms
import numpy as np
import pytest
from claimed_machines import LIMITED
from mechanisms import CLIENTS

import pteron
from pteron.controllers import ComputedTorque
from pteron.legs import Drive, LuGre
from pteron.manipulator import parameter_data, parameters
from pteron.motion import Sensors, advance, pick_and_place, simulate
from pteron.viewer.pushing import Push
from pteron.workspace import home_pose

LAWS = {
    "coulomb": Drive(coulomb=40.0),
    "stribeck": Drive(coulomb=20.0, stribeck=pteron.legs.Stribeck(30.0, 0.05)),
    "bristles": Drive(
        coulomb=40.0, stribeck=pteron.legs.Stribeck(20.0, 0.05), lugre=LuGre(1e4, 90.0)
    ),
    "viscous too": Drive(coulomb=40.0, viscous=3.0, rotor_inertia=0.05),
}


def driven(robot, *drives):
    drives = drives * robot.joint_count if len(drives) == 1 else drives
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))


def test_less_than_breakaway_moves_nothing_to_the_last_bit():
    robot = pteron.load("quadrupteron")
    breakaway = np.array([3.0, 4.0, 5.0, 6.0])
    drives = [Drive(coulomb=f, viscous=5.0, rotor_inertia=0.1) for f in breakaway]
    robot = driven(robot, *drives)
    home, rest = home_pose(robot), np.zeros(4)
    holding = pteron.inverse_dynamics(robot, home, rest, rest)
    given = {"start": (home, rest), "duration": 0.05}
    for share in (0.0, 0.999999, -0.999999):
        still = simulate(robot, forces=holding + share * breakaway, **given)
        np.testing.assert_array_equal(still.pose, np.tile(home, (51, 1)))
        for nothing in (still.velocity, still.acceleration, still.joint_rates):
            assert not nothing.any()
    moving = simulate(robot, forces=holding + 1.000001 * breakaway, **given)
    assert (moving.joint_rates[-1] > 0.0).all()
    # What pulls at one joint moves that one; the others, that hold it, stay.
    one = simulate(robot, forces=holding + 2.0 * breakaway * [1, 0, 0, 0], **given)
    assert one.joint_rates[-1, 0] > 0.01
    assert np.abs(one.joints[:, 1:] - one.joints[0, 1:]).max() < 1e-14
    # Thrown, it comes to rest, and then stays.
    rates = np.linalg.solve(pteron.jacobian(robot, home), [0.05, -0.02, 0.0, 0.03])
    thrown = simulate(robot, forces=holding, start=(home, rates), duration=0.2)
    assert thrown.velocity[1].any()
    assert not thrown.velocity[-50:].any()
    assert (thrown.pose[-50:] == thrown.pose[-1]).all()


class Belt:
    """A spring on the first joint whose other end moves on, taken in the middle of each period."""

    def __init__(self, stiffness, speed, start, period):
        self.stiffness, self.speed, self.start, self.period = stiffness, speed, start, period

    def law(self, model):
        return self

    def memory(self, pose, velocity):
        return np.zeros(1)

    def __call__(self, pose, velocity, acceleration, joints, joint_rates, memory):
        half = 0.5 * self.period
        stretch = self.speed * (memory[0] + half) - (joints[0] - self.start)
        force = self.stiffness * (stretch - half * joint_rates[0])
        return np.array([force, 0.0, 0.0]), memory + self.period


def test_stick_slip_on_a_belt_is_that_of_the_closed_form():
    """A mass on a slider; the others stick, and carry it. Slips are theta / omega long."""
    stiffness, speed, kinetic, more = 1000.0, 0.05, 3.0, 2.0
    robot = pteron.load("tripteron")
    masses = [
        value if (data.kind, data.body) == ("m", "p") else 1e-9 * value
        for data, value in zip(parameter_data(robot), parameters(robot), strict=True)
    ]
    robot = pteron.with_parameters(robot, masses)
    slips = Drive(coulomb=kinetic, stribeck=pteron.legs.Stribeck(more, 1e-6))
    robot = driven(robot, slips, *2 * [Drive(coulomb=1e3)])
    rest = np.zeros(3)
    omega = np.sqrt(stiffness / pteron.mass_matrix(robot, rest)[0, 0])
    jump = more / stiffness
    theta = 2.0 * np.pi - 2.0 * np.arctan(jump * omega / speed)
    slip = speed * theta / omega + jump * (1.0 - np.cos(theta)) - speed / omega * np.sin(theta)
    start = pteron.inverse_kinematics(robot, rest)[0]
    belt = Belt(stiffness, speed, start, 2e-4)
    found = simulate(robot, None, belt, start=(rest, rest), duration=0.6, step=2e-4)
    moving = found.joint_rates[:, 0] != 0.0
    levels = np.unique(found.joints[~moving, 0])
    np.testing.assert_allclose(np.diff(levels), slip, rtol=1e-3)
    changes = found.time[np.flatnonzero(np.diff(moving.astype(int)))]
    np.testing.assert_allclose(changes[0], (kinetic + more) / stiffness / speed, atol=1e-3)
    np.testing.assert_allclose(changes[1::2] - changes[::2][: len(changes) // 2], theta / omega,
                               atol=6e-4)  # fmt: skip
    np.testing.assert_allclose(changes[2] - changes[0], slip / speed, atol=6e-4)
    assert np.abs(found.joints[:, 1:] - found.joints[0, 1:]).max() < 1e-18


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", mechanisms.gated(["quadrupteron", "delta", "par4"], ["delta"]))
def test_no_law_of_friction_brings_energy(name, law):
    robot = replace(driven(pteron.load(name), LAWS[law]), gravity=(0.0, 0.0, 0.0))
    pose = pteron.random_poses(robot, 20, seed=3, type_i=0.2, type_ii=0.1)
    velocity = 0.3 * np.random.default_rng(3).normal(size=pose.shape)
    rotors = np.diag([leg.drive.inertia for leg in robot.legs])

    stiffness = LAWS[law].lugre.stiffness if LAWS[law].lugre else 0.0

    def energy():
        rates = pteron.kinematics.joint_rates(robot, pose, velocity).actuated
        own = 0.5 * np.einsum("ki,ij,kj->k", rates, rotors, rates)
        bent = 0.5 * stiffness * (drives**2).sum(axis=-1)
        return pteron.kinetic_energy(robot, pose, velocity) + own + bent

    drives = np.zeros((20, robot.joint_count if stiffness else 0))
    steps = 4 if stiffness else 1  # 0.5 ms is too long for stiff bristles
    last = begun = energy()
    for _ in range(60):
        pose, velocity, drives, going = advance(
            robot, pose, velocity, np.zeros_like(pose), 5e-4 / steps, steps, drives=drives
        )
        assert going.all()
        now = energy()
        assert (now <= last + 1e-12 * begun).all()
        last = now
    assert (last < 0.9 * begun).all()
    assert stiffness or (last == 0.0).any()


def narrow(name, **drive):
    """Return a machine whose joints go 5 cm, or 0.05 rad, to either side of home, and home."""
    robot, home = pteron.load(name), home_pose(name)
    joints = zip(robot.legs, pteron.inverse_kinematics(robot, home).tolist(), strict=True)
    legs = tuple(replace(leg, limits=(at - 0.05, at + 0.05)) for leg, at in joints)
    return driven(replace(robot, legs=legs), Drive(**drive)), home


@pytest.mark.parametrize("name", LIMITED)
def test_friction_holds_a_joint_at_its_limit_and_beyond_it_a_simulation_ends(name, monkeypatch):
    robot, home = narrow(name)
    rest = np.zeros(robot.freedom)
    held = pteron.inverse_dynamics(robot, home, rest, rest)
    dry = 0.3 * float(np.abs(held).max()) + 0.1
    robot = driven(robot, Drive(coulomb=dry, rotor_inertia=0.01))
    at = float(pteron.inverse_kinematics(robot, home)[0])
    first = replace(robot.legs[0], limits=(at - 0.05, at))
    robot = replace(robot, legs=(first, *robot.legs[1:]))

    class Same:
        """Asks for the same forces at every sample."""

        period, law = 1e-3, lambda self, _: self

        def __init__(self, forces):
            self.forces = forces

        def memory(self, *_):
            return np.zeros(1)

        def __call__(self, *told):
            return self.forces, told[-1]

    for share, moves in ((0.9, False), (2.0, True)):
        law = Same(held + share * dry * (np.arange(len(held)) == 0))
        monkeypatch.setenv("PTERON_KERNELS", "vm")
        slow = simulate(robot, None, law, start=(home, rest), duration=0.01)
        monkeypatch.delenv("PTERON_KERNELS")
        found = simulate(robot, None, law, start=(home, rest), duration=0.01)
        for part in ("time", "pose", "velocity", "acceleration", "joints", "forces"):
            np.testing.assert_array_equal(getattr(found, part), getattr(slow, part))
        assert found.stopped == slow.stopped
        if moves:
            assert "leg 1: " in found.stopped
            assert "comes to its limit" in found.stopped
            assert len(found.time) == 2
        else:
            assert found.stopped is None
            np.testing.assert_array_equal(found.pose, np.tile(home, (11, 1)))


@pytest.mark.parametrize("name", LIMITED)
@pytest.mark.parametrize("share", mechanisms.gated([0.0, 0.05], [0.0]))
def test_what_meets_its_limits_in_the_live_view_gains_no_energy_and_rests_there(name, share):
    """Thrown without gravity: it slid on with what was left of its way, at up to 500 times as much.

    Let fall with friction, it comes to rest against its limits, to the last bit.
    """
    robot, home = narrow(name, rotor_inertia=1e-4)
    robot = replace(robot, gravity=(0.0, 0.0, 0.0)) if not share else robot
    rest, rng = np.zeros(robot.freedom), np.random.default_rng(1)
    weight = float(np.abs(pteron.inverse_dynamics(robot, home, rest, rest)).max())
    robot = driven(robot, Drive(coulomb=share * weight, rotor_inertia=1e-4))
    push, met = Push(robot, home, "off: no force"), 0
    velocity = rng.normal(size=len(rest)) * (not share)
    rates = pteron.jacobian(robot, home) @ velocity
    push.velocity = velocity * 0.5 / max(np.abs(rates).max(), 1e-9)

    def energy():
        rates = pteron.kinematics.joint_rates(robot, push.pose, push.velocity).actuated
        bodies = pteron.kinetic_energy(robot, push.pose, push.velocity)
        return bodies + pteron.potential_energy(robot, push.pose) + 5e-5 * (rates**2).sum()

    energies = [energy()]
    for _ in range(150):
        push.go(1.0 / 60.0)
        met += bool(push.stops)
        energies.append(energy())
    assert met > 5 or weight < 1e-9
    assert np.diff(energies).max() <= 1e-9 * np.ptp(energies)
    if share:
        last = push.pose
        push.go(1.0 / 60.0)
        np.testing.assert_array_equal(push.pose, last)
        assert not push.velocity.any()


def test_bristles_come_to_friction_that_sticks_as_they_are_stiffened():
    robot = pteron.load("delta")
    home, rest = home_pose(robot), np.zeros(3)
    holding = pteron.inverse_dynamics(robot, home, rest, rest)
    start = home, np.linalg.solve(pteron.jacobian(robot, home), [0.5, 0.3, -0.4])
    given = {"start": start, "forces": holding, "duration": 0.15, "step": 4e-4}
    sticks = Drive(coulomb=8.0, rotor_inertia=0.02)
    exact = simulate(driven(robot, sticks), **given)
    assert not exact.velocity[-20:].any()
    off = []
    for stiffness in (2e2, 2e3, 2e4):
        bristles = LuGre(stiffness, np.sqrt(0.02 * stiffness))
        found = simulate(driven(robot, replace(sticks, lugre=bristles)), **given)
        off.append(np.abs(found.joints - exact.joints).max())
    assert off[2] < 1e-3
    assert off[2] < 0.2 * off[1] < 0.06 * off[0]
    with pytest.raises(pteron.DataError, match="leg 1: the stiffness of its bristles asks"):
        simulate(driven(robot, replace(sticks, lugre=LuGre(2e9))), **given)
    with pytest.raises(pteron.ModelError, match="lugre: needs coulomb"):
        Drive(lugre=LuGre(1e4))


def test_steps_are_of_fourth_order_and_of_second_across_a_stop():
    robot = driven(pteron.load("delta"), Drive(coulomb=2.0, viscous=1.0, rotor_inertia=0.02))
    home, rest = home_pose(robot), np.zeros(3)
    holding = pteron.inverse_dynamics(robot, home, rest, rest)
    rates = np.linalg.solve(pteron.jacobian(robot, home), [0.5, 0.3, -0.4])

    def end(forces, duration, count):
        pose, *_ = advance(robot, home, rates, forces, duration / count, count)
        return pose

    def order(forces, duration, counts, reference):
        exact = end(forces, duration, reference)
        off = [np.abs(end(forces, duration, n) - exact).max() for n in counts]
        return np.log2(off[0] / off[1]) / np.log2(counts[1] / counts[0])

    push = np.array([3.0, 3.0, -3.0])  # more than friction: all go on as they do
    assert 3.6 < order(holding + push, 0.2, (8, 16), 256) < 4.6
    # On the way all joints stop, at instants that are no multiples of a step: orders vary about 2.
    found = [order(holding, 0.1, (n, 8 * n), 4096) for n in (29, 37)]
    assert 1.3 < np.mean(found) < 3.0


def test_steps_are_halved_until_a_stated_error_is_met(monkeypatch):
    monkeypatch.delenv("PTERON_KERNELS")
    robot = driven(pteron.load("delta"), Drive(coulomb=8.0, viscous=1.0, rotor_inertia=0.02))
    home, rest = home_pose(robot), np.zeros(3)
    holding = pteron.inverse_dynamics(robot, home, rest, rest)
    start = home, np.linalg.solve(pteron.jacobian(robot, home), [0.5, 0.3, -0.4])
    given = {"start": start, "forces": holding, "duration": 0.1, "period": 0.01}
    exact = simulate(robot, step=2.5e-5, **given)
    steps = []
    for error in (1e-5, 1e-7):
        found = simulate(robot, step=5e-3, error=error, **given)
        assert np.abs(found.pose - exact.pose).max() < error
        steps.append(found.step)
    assert 5e-3 > steps[0] > steps[1]
    for more, message in (
        ({"error": -1.0}, "error: -1.0 given"),
        ({"error": 1e-6, "method": "dop853"}, 'goes with method "rk4"'),
        ({"error": 1e-19, "step": 0.01}, "still change poses by"),
    ):
        with pytest.raises(pteron.DataError, match=message):
            simulate(robot, **given | more)


@pytest.mark.parametrize("seed", range(4))
def test_a_stated_error_is_kept_where_joints_reverse(seed, monkeypatch):
    """A step that holds a reversal is of first order; halved steps may divide it alike."""
    monkeypatch.delenv("PTERON_KERNELS")
    robot = driven(pteron.load("delta"), Drive(coulomb=5.0, rotor_inertia=1e-4, ratio=10.0))
    velocity = [0.0, 0.0, 0.25] if seed == 0 else np.random.default_rng(seed).normal(size=3) / 5
    given = {"start": (home_pose(robot), velocity), "duration": 0.1, "period": 0.001}
    exact = simulate(robot, step=1.1e-7, **given)
    found = simulate(robot, error=1e-6, **given)
    assert np.abs(found.pose - exact.pose).max() < 1e-6


def test_one_step_of_dop853_a_sample_is_of_eighth_order():
    robot = pteron.load("delta")
    home, rest = home_pose(robot), np.zeros(3)
    forces = pteron.inverse_dynamics(robot, home, rest, rest) + np.array([0.2, -0.1, 0.3])
    start = home, np.array([0.3, 0.2, -0.2])
    given = {"start": start, "forces": forces, "duration": 0.16, "method": "dop853"}
    exact = simulate(robot, period=0.01, tolerance=1e-13, **given).pose[-1]
    off = [
        np.abs(simulate(robot, period=h, tolerance=1e6, **given).pose[-1] - exact).max()
        for h in (0.08, 0.04)
    ]
    assert 7.0 < np.log2(off[0] / off[1]) < 10.0


@pytest.mark.parametrize("share", [1.5, 0.9])
@pytest.mark.parametrize("name", mechanisms.gated(["quadrupteron", "delta"], ["delta"]))
def test_mujocos_friction_comes_to_it_as_its_step_and_softness_shrink(name, share):
    """All joints stuck, or some sliding: MuJoCo's creep with less and less, ours not at all."""
    mujoco = pytest.importorskip("mujoco")
    from pteron.export import coordinates, mjcf, tree

    breakaway = np.linspace(4.0, 7.0, 4)[: pteron.load(name).joint_count]
    breakaway = breakaway * (0.4 if name == "delta" else 1.0)
    drives = [Drive(coulomb=f, viscous=0.5, rotor_inertia=0.1) for f in breakaway]
    robot = driven(pteron.load(name), *drives)
    robot = replace(robot, legs=tuple(replace(leg, limits=None) for leg in robot.legs))
    home, rest = home_pose(robot), np.zeros(robot.freedom)
    push = breakaway * np.array([share, -0.5, share, 0.6])[: len(breakaway)]
    forces = pteron.inverse_dynamics(robot, home, rest, rest) + push
    found = simulate(robot, start=(home, rest), forces=forces, duration=0.02)
    opened, off = tree(robot), []
    names = [joint.name for joint in opened.joints]
    for step in (2e-4, 5e-5):
        model = mujoco.MjModel.from_xml_string(mjcf(opened, step=step))
        dry = model.dof_frictionloss > 0.0
        model.dof_solref[dry], model.dof_solimp[dry] = (
            (2.0 * step, 1.0),
            (0.9999, 0.9999, 1e-3, 0.5, 2),
        )
        model.opt.iterations, model.opt.tolerance = 200, 1e-14
        data = mujoco.MjData(model)
        data.qpos[:] = coordinates(opened, home[None])[0]
        data.qvel[:], data.ctrl[:] = 0.0, forces
        rates = []
        for _ in range(20):
            mujoco.mj_step(model, data, round(1e-3 / step))
            rates.append(data.qvel[[names.index(joint) for joint in robot.joint_names]])
        off.append(np.abs(np.array(rates) - found.joint_rates[1:]).max())
    assert off[1] < 1e-7  # in m/s or rad/s, where what slides has 0.02
    assert off[1] < 0.3 * off[0]
    stuck = np.array([share < 1.0, True, share < 1.0, True])[: len(breakaway)]
    assert (np.abs(found.joint_rates[:, stuck]) < 1e-16).all()
    assert (np.abs(found.joint_rates[-1, ~stuck]) > 0.01).all()


@CLIENTS
@pytest.mark.parametrize(
    "drive",
    [
        Drive(coulomb=3.0, viscous=9.0, rotor_inertia=0.1),
        Drive(coulomb=3.0, rotor_inertia=0.1, elastic=pteron.legs.Elastic(3e4, 5.0)),
    ],
    ids=["rigid", "elastic"],
)
def test_a_state_goes_on_alone_as_beside_others_that_stick_and_in_numpy(drive, monkeypatch):
    robot = driven(pteron.load("quadrupteron"), drive)
    home, rng = home_pose(robot), np.random.default_rng(3)
    pose = home + 0.01 * rng.normal(size=(21, 4))
    velocity = 0.2 * rng.normal(size=pose.shape) * (rng.random((21, 1)) < 0.6)
    holding = pteron.inverse_dynamics(robot, pose, 0.0 * pose, 0.0 * pose)
    forces = holding + 4.0 * rng.normal(size=holding.shape)
    given = pose, velocity, forces
    in_numpy = advance(robot, *given, 1e-4, 30)
    monkeypatch.delenv("PTERON_KERNELS")
    beside = advance(robot, *given, 1e-4, 30)
    alone = [advance(robot, *(part[k] for part in given), 1e-4, 30) for k in range(21)]
    rests = ~beside[1].any(axis=1)
    if drive.elastic is None:
        assert 0 < rests.sum() < 21
    for part, values in enumerate(beside):
        np.testing.assert_array_equal(values, in_numpy[part])
        np.testing.assert_array_equal(values, [one[part] for one in alone])


@CLIENTS
def test_a_controllers_loop_is_the_same_in_c_in_numpy_and_called_back(monkeypatch):
    robot = driven(pteron.load("quadrupteron"), Drive(coulomb=3.0, viscous=9.0, max_force=60))
    motion = pick_and_place(robot, home_pose(robot), least=0.1)
    sensors = Sensors(1e-6, cutoff=300.0, noise=2e-7, seed=4)
    given = {"sensors": sensors, "delay": 7e-4, "duration": 0.02, "payload": [(0.01, 0.2)]}

    class CalledBack:
        period = 1e-3

        def law(self, model):
            law = ComputedTorque().law(model)

            class Wrapped:
                def memory(self, pose, velocity):
                    return law.memory(pose, velocity)

                def __call__(self, *sample):
                    return law(*sample)

            return Wrapped()

    slow = simulate(robot, motion, ComputedTorque(), **given)
    runs = [simulate(robot, motion, CalledBack(), **given)]
    monkeypatch.delenv("PTERON_KERNELS")
    runs += [simulate(robot, motion, kind(), **given) for kind in (ComputedTorque, CalledBack)]
    parts = (
        "pose",
        "velocity",
        "acceleration",
        "joints",
        "joint_rates",
        "forces",
        "asked",
        "memory",
    )
    for run in runs:
        for part in parts:
            np.testing.assert_array_equal(getattr(run, part), getattr(slow, part))
    other = simulate(
        robot, motion, ComputedTorque(), **{**given, "sensors": replace(sensors, seed=5)}
    )
    assert (other.pose[-1] != slow.pose[-1]).any()


def test_an_error_in_a_controller_of_ones_own_comes_through(monkeypatch):
    class Broken:
        period = 1e-3

        def law(self, model):
            return self

        def memory(self, pose, velocity):
            return np.zeros(0)

        def __call__(self, *sample):
            raise KeyError("gain")

    robot, rest = pteron.load("tripteron"), np.zeros(3)
    for _ in range(2):
        with pytest.raises(KeyError, match="gain"):
            simulate(robot, None, Broken(), start=(rest, rest), duration=0.01)
        monkeypatch.delenv("PTERON_KERNELS", raising=False)

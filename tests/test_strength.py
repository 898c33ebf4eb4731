"""Sag, stress, buckling, frequencies and joint loads of a Delta against formulas of beams."""

from dataclasses import replace
from math import atan2, cos, inf, pi, sin, sqrt

import numpy as np
import pytest

import pteron
from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.design.structure import Demand, Structure
from pteron.indices.elasticity import ALUMINIUM, CARBON, Elasticity
from pteron.indices.strength import Tube, link_loads
from pteron.motion import with_payload
from pteron.parts.drives import GEARBOXES, MOTORS, Options, read_gearboxes
from pteron.parts.joints import JOINT_PARTS, cheapest_joint, read_joints
from pteron.workspace import home_pose

G = 9.81
CRANK = Tube(0.04, 0.036, ALUMINIUM)
ROD = Tube(0.014, 0.012, CARBON, 2, 0.1)


def built_delta(crank_mass):
    """Return a Delta of uniform cranks and nearly massless rods and platform, and a level pose."""
    robot = pteron.load("delta")
    legs = []
    for leg in robot.legs:
        a = leg.upper_length
        upper = PlanarInertia.of_body(crank_mass, (a / 2.0, 0.0), crank_mass * a**2 / 3.0)
        lower = RodInertia.of_body(1e-9, (-0.1,), 1e-9)
        legs.append(replace(leg, upper=upper, lower=lower, drive=None))
    kind = type(robot.platform.inertia)
    light = kind.of_values([1e-9 * float(k[0] in "mI" and "g" not in k) for k in kind.kinds])
    platform = replace(robot.platform, inertia=light)
    robot = replace(robot, legs=tuple(legs), platform=platform)
    return robot, np.array([0.0, 0.0, home_pose(robot)[2]])


def statics(robot, pose, load):
    """Return crank angle, rod tension and its components along and across the crank."""
    leg = robot.legs[0]
    point = np.add(leg.platform_point, leg.fixed_offset) + pose
    hinge, end = (np.array([p[0], p[2]]) for p in (leg.guide_point, point))
    between = end - hinge
    distance = np.linalg.norm(between)
    share = (distance**2 + leg.upper_length**2 - leg.lower_length**2) / (2.0 * distance)
    height = sqrt(leg.upper_length**2 - share**2)
    across = np.array([-between[1], between[0]]) / distance
    elbow = hinge + share * between / distance + height * across  # the outer intersection
    way = (end - elbow) / leg.lower_length
    tension = load / (-3.0 * way[1])
    along = (elbow - hinge) / leg.upper_length
    across = np.array([-along[1], along[0]])
    return atan2(along[1], along[0]), tension, tension * way @ along, tension * way @ across


@pytest.mark.filterwarnings("ignore::pteron.errors.UnlikelyValue")
@pytest.mark.parametrize("crank_mass", [1e-9, 2.0])
def test_sag_and_stress_are_those_of_beams(crank_mass):
    load, stiffness = 30.0, 2e4
    bare, pose = built_delta(crank_mass)
    robot = with_payload(bare, load / G)
    angle, tension, along, across = statics(robot, pose, load)
    a, length = robot.legs[0].upper_length, robot.legs[0].lower_length
    _, _, unit_along, unit_across = statics(robot, pose, 1.0)
    q_along, q_across = (crank_mass * G / a * x for x in (-sin(angle), -cos(angle)))
    e_i = ALUMINIUM.young * CRANK.second_moment
    e_a = ALUMINIUM.young * CRANK.area
    torque, unit_torque = across * a + q_across * a**2 / 2.0, unit_across * a
    sag = 3.0 * (
        tension * (tension / load) * length / (2.0 * CARBON.young * ROD.area)
        + unit_across * (across * a**3 / 3.0 + q_across * a**4 / 8.0) / e_i
        + unit_along * (along * a + q_along * a**2 / 2.0) / e_a
        + torque * unit_torque / stiffness
    )
    structure = Structure(
        robot, pose[None], Demand(0.0, 0.0, np.zeros(0), 0.0), {"upper": CRANK, "lower": ROD}
    )
    assert structure.sag(np.full(3, stiffness))[0] == pytest.approx(sag, rel=1e-7)
    assert structure.sags(np.array([stiffness]))[0] == pytest.approx(sag, rel=1e-7)
    assert structure.holding[0] == pytest.approx(abs(torque), rel=1e-7)
    # The joints' loads, and the crank's stress at its root.
    elbow = structure.joints[0][0]
    assert (elbow.kind, elbow.parts) == ("ball", 2)
    assert elbow.force[0] == pytest.approx(tension / 2.0, rel=1e-6)
    modulus = CRANK.second_moment / (CRANK.outer / 2.0)
    bump = abs(q_across) * a**2 / 8.0  # counted in full, though it is not at the root
    axial = max(abs(along), abs(along + q_along * a))
    root = axial / CRANK.area + (abs(torque) + bump) / modulus
    assert structure.stress_share[0] == pytest.approx(root / ALUMINIUM.strength, rel=1e-6)
    assert structure.buckling_factor[0] > 1e3  # everything hangs
    own = (
        pi
        / (2.0 * length**2)
        * sqrt(CARBON.young * ROD.second_moment / (CARBON.density * ROD.area))
    )
    assert structure.link_frequency[0] == pytest.approx(own, rel=1e-9)


@pytest.mark.filterwarnings("ignore::pteron.errors.UnlikelyValue")
def test_a_standing_machine_is_pressed_until_it_buckles():
    bare, pose = built_delta(1e-9)
    robot = replace(with_payload(bare, 3.0), gravity=(0.0, 0.0, G))
    _, tension, *_ = statics(robot, pose, 3.0 * G)
    structure = Structure(
        robot, pose[None], Demand(0.0, 0.0, np.zeros(0), 0.0), {"upper": CRANK, "lower": ROD}
    )
    length = robot.legs[0].lower_length
    euler = pi**2 * CARBON.young * ROD.second_moment / length**2
    assert structure.buckling_factor[0] == pytest.approx(euler / (tension / 2.0), rel=1e-6)


@pytest.mark.parametrize("name", ["tripteron", "h4", "stewart", "5-rpur", "delta-redundant"])
def test_no_motion_within_the_demand_loads_more_than_its_bounds(name):
    robot = pteron.load(name)
    rng = np.random.default_rng(0)
    count, m = len(robot.platform.lengths), robot.freedom
    pose = home_pose(robot)
    demand = Demand(0.8, 12.0, np.full(m - count, 15.0), 20.0)
    rods = max(getattr(leg, "rods", 1) for leg in robot.legs)
    tubes = {"upper": CRANK, "lower": replace(ROD, count=rods, spacing=0.1 if rods > 1 else inf)}
    structure = Structure(robot, pose[None], demand, tubes)
    cases = 300
    velocity, acceleration = np.zeros((2, 1, cases, m))
    unit = rng.normal(size=(3, cases, count))
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    velocity[0, :, :count], acceleration[0, :, :count] = 0.8 * unit[0], 12.0 * unit[1]
    acceleration[0, :, count:] = rng.choice([-15.0, 15.0], size=(cases, m - count))
    force = rng.normal(size=(1, cases, structure.loads.tool_actuators.shape[-1]))
    force *= 20.0 / np.linalg.norm(force, axis=-1, keepdims=True)
    elastic = Elasticity(1e5, CRANK.section, tubes["lower"].section, 0.1 if rods > 1 else None)
    loads = link_loads(robot, pose[None], velocity, acceleration, force, elastic)
    drawn = np.abs(loads.actuators[0]).max(axis=0)
    assert (drawn <= structure.actuators[0] * (1.0 + 1e-9)).all()
    assert (drawn >= 0.5 * structure.actuators[0]).all()
    # Moving the demand's own states through the same bounds: forces in the joints.
    middle, spread = structure._cases.bounds(structure.loads.joints)
    inside = np.abs(loads.joints[0] - middle[0]) <= spread[0] + 1e-6 * np.nanmax(spread[0])
    assert inside[np.isfinite(loads.joints[0])].all()


def test_parts_fit_their_joints():
    gearboxes = read_gearboxes(GEARBOXES)
    motors = pteron.motion.read_motors(MOTORS)
    names = {
        joint: " ".join(o.gearbox.name for o in Options.combine(motors, gearboxes, joint, 0.05).all)
        for joint in ("rad", "slider", "ram")
    }
    assert "planetary" in names["rad"]
    assert "belt" not in names["rad"] + names["ram"]
    assert "belt" in names["slider"]
    assert "screw" in names["slider"]
    assert "screw" in names["ram"]
    direct = next(
        o for o in Options.combine(motors, gearboxes, "rad", 0.05).all if o.gearbox.ratio == 1.0
    )
    assert direct.stiffness <= direct.motor.shaft_stiffness
    # A long screw turns no faster than its critical speed allows, and its inertia counts.
    options = Options.combine(motors, gearboxes, "ram", 0.05)
    short, long = options.numbers(0.1), options.numbers(1.5)
    assert (long[1] > short[1]).all()
    assert (long[4] < short[4]).any()
    assert (long[7] < short[7]).all()
    drive = options.all[0].drive(1.5)
    assert drive.screw is not None
    assert drive.screw.length == pytest.approx(1.6)
    joints = read_joints(JOINT_PARTS)
    small, large = (cheapest_joint(joints, "ball", np.array([f]), np.zeros(1)) for f in (1e3, 1e4))
    assert small.price < large.price
    assert cheapest_joint(joints, "ball", np.array([1e7]), 0) is None

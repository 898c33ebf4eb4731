"""Machines that are singular at every pose, and the type-II measure at singular poses."""

from dataclasses import replace

import degraded
import descriptions
import numpy as np
import pytest
import singular_poses
from mechanisms import CATALOG, NIGHTLY, gated, random_machine, states

import pteron
from pteron.kernels import numeric
from pteron.workspace import Box, free_of_singularities, prove


@pytest.mark.parametrize(
    ("kinds", "fault", "expected"),
    [
        ("PRS", degraded.coincident, "flagged"),
        ("SSSSI", degraded.in_line, "flagged"),
        ("RRR", degraded.alongside, "flagged"),
        *(
            pytest.param(kinds, fault, "flagged", marks=NIGHTLY)
            for kinds, fault in (
                ("CS", degraded.coincident),
                ("CCC", degraded.in_line),
                ("PPP", degraded.in_a_plane),
                ("PPPP", degraded.mirrored),
            )
        ),
        ("CPR", degraded.across_the_plane, "refused"),
        ("LP", degraded.slanted, "refused"),
        ("CCU", degraded.no_gear, "refused"),
        ("PRSU", degraded.two_shafts, "refused"),
    ],
)
def test_a_machine_with_a_useless_leg_is_not_answered(kinds, fault, expected):
    robot = random_machine(1, kinds)
    assert degraded.judged(lambda: fault(robot, np.random.default_rng(1))) == expected


def test_the_published_example_is_refused_with_the_reason():
    """A P-R-R-R leg whose joint moves nothing in the plane of a planar machine."""
    robot = CATALOG["3-prr"]
    old = robot.legs[2]
    leg = pteron.legs.PRRR(
        guide_point=old.guide_point,
        direction=robot.platform.axis,
        platform_point=old.platform_point,
        upper_length=0.2,
        lower_length=0.2,
        slider_mass=old.slider_mass,
        upper=old.lower,
        lower=old.lower,
    )
    with pytest.raises(
        pteron.ModelError, match="leg 3: its joint does not move the platform: a PRRR leg"
    ):
        replace(robot, legs=(*robot.legs[:2], leg))


@pytest.mark.parametrize(
    "kinds", gated(["RRR", "PRSU", "CS", "CR", "LS", "CPR", "CSS", "LRU"], ["PRSU", "LRU"])
)
def test_the_measure_vanishes_at_singular_poses(kinds):
    robot = random_machine(3, kinds)
    rng = np.random.default_rng(3)
    tried = list(singular_poses.found(robot, rng))
    assert tried
    for one, pose in tried:
        size, slope = singular_poses.slopes(one, pose, rng)
        assert size < 1e-12
        assert slope <= 10.0


def test_a_layout_that_no_pose_reaches_is_not_told_regular():
    robot = CATALOG["delta"]
    far = replace(robot.legs[0], guide_point=(50.0, 0.0, 0.0))
    with pytest.raises(pteron.ModelError, match="no pose was found that all legs reach"):
        pteron.kinematics.architecture(replace(robot, legs=(far, *robot.legs[1:])))


def test_no_box_with_a_rod_across_the_plane_is_proved():
    robot = singular_poses.across_the_plane(random_machine(0, "CS"), np.random.default_rng(0))
    for middle in (np.zeros(2), np.array([1e-7, 0.0])):
        box = Box(middle - 2e-7, middle + 2e-7)
        assert prove(robot, box, type_ii=1e-3).holds is False
        assert free_of_singularities(robot, box).free is not True
    rest = np.zeros(2)
    with pytest.raises(pteron.SingularPose, match="type II"):
        pteron.inverse_dynamics(robot, rest, rest, rest)
    away = np.array([0.02, 0.01])
    size = abs(float(numeric(robot, "type_ii")(away)[0]))
    assert 0.0 < size < 0.1
    assert np.isfinite(pteron.inverse_dynamics(robot, away, rest, rest)).all()
    assert prove(robot, Box(away - 1e-4, away + 1e-4), type_ii=0.5 * size).holds


@pytest.mark.parametrize("kinds", gated(["CS", "CPR", "LRU", "PRSU"], ["CPR", "PRSU"]))
def test_the_measure_of_a_mixed_machine_is_that_of_forces_in_space(kinds):
    robot = random_machine(2, kinds)
    poses, machine = states(robot, 4)[0], descriptions.describe(robot)
    rows, sizes = (
        descriptions.jacobians(machine, poses)[0],
        descriptions.force_sizes(machine, poses),
    )
    lengths = len(robot.platform.lengths)
    forces = sum(not leg.follows_angle for leg in robot.legs)
    most = (forces / lengths) ** (lengths / 2)
    if forces == robot.freedom and robot.platform.turns:
        points = np.array([leg.platform_point[:2] for leg in robot.legs])
        most *= np.linalg.norm(points - points.mean(axis=0))
    expected = np.abs(np.linalg.det(rows)) / sizes.prod(axis=-1) / most
    found = np.abs(numeric(robot, "type_ii")(poses)[0])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


_CORNERS = ((0.0, 0.0, 0.0), (1.6, 0.0, 0.0), (0.4, 1.2, 0.0))
_PLATE = ((0.0, 0.0, 0.0), (0.8, 0.3, 0.0), (0.0, 0.7, 0.0))


@pytest.mark.parametrize(
    ("shares", "singular"),
    [
        ((0.5, 0.5, 0.5, 0.5, 0.5, 0.5), True),
        ((0.2, 0.5, 0.6, 0.5, 0.5, 8.0 / 11.0), True),  # ratios 1/4, 1, 3/2 and 1, 1, 8/3
        ((0.2, 0.5, 0.6, 0.5, 0.5, 0.5), False),
        ((0.3, 0.4, 0.6, 0.7, 0.2, 0.45), False),
    ],
)
def test_corners_on_the_others_sides_are_singular_where_six_ratios_multiply_to_one(
    shares, singular
):
    """Griffis and Duffy's layout: the condition of docs/theory/singularities.md."""
    t, u = np.split(np.array(shares), 2)
    hexapod = pteron.load("stewart")
    corners, plate = np.array(_CORNERS), np.array(_PLATE)
    sides = (
        (1.0 - v)[:, None] * np.roll(triangle, -1, axis=0)
        + v[:, None] * np.roll(triangle, -2, axis=0)
        for v, triangle in ((u, corners), (t, plate))
    )
    on_base, on_plate = sides
    ends = zip(
        hexapod.legs,
        np.vstack([corners, on_base]),
        np.vstack([on_plate, plate]),
        strict=True,
    )
    legs = tuple(
        replace(leg, guide_point=tuple(a), platform_point=tuple(b), limits=(0.01, 50.0))
        for leg, a, b in ends
    )
    found = pteron.kinematics.architecture(replace(hexapod, legs=legs))
    assert found.singular == singular
    ratios = np.prod(np.array(shares) / (1.0 - np.array(shares)))
    assert np.isclose(ratios, 1.0) == singular


def test_the_type_ii_bound_is_not_reached_by_table_1s_platform_points():
    """27/32 of it is the most: forces across the arms that rise and fall by 30 degrees in turn."""
    robot, rng = CATALOG["quadrupteron"], np.random.default_rng(5)
    flat, up = np.sqrt(0.75), 0.5
    best = np.array([(flat, 0, up), (0, -flat, -up), (flat, 0, -up), (0, -flat, up)])

    def measure(directions):
        units = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        legs = zip(robot.legs, units, strict=True)
        turned = replace(robot, legs=tuple(replace(leg, direction=tuple(d)) for leg, d in legs))
        return abs(float(numeric(turned, "type_ii")(np.zeros(4))[0]))

    assert measure(best) == pytest.approx(27.0 / 32.0, abs=1e-12)
    assert measure(best + 0.05 * rng.normal(size=(4, 3))) < 27.0 / 32.0
    assert measure(rng.normal(size=(4, 3))) < 27.0 / 32.0

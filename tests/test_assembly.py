"""All poses of given joints, however many there are: modes counted another way, and followed."""

from itertools import product

import mpmath
import numpy as np
import pytest
import sympy
from counted_modes import count_modes
from mechanisms import CATALOG, CLIENTS, gated, random_machine, with_elbows

import pteron
from pteron.equations.machine import closure_of
from pteron.errors import DataError, ModelError, UnreachablePose
from pteron.kernels import numeric

MOST = {
    "RRRR": 8,
    "SSSS": 8,
    "RRSP": 8,
    "RSPP": 8,
    "RPPP": 4,
    "CCC": 6,
    "LLL": 6,
    "CLP": 6,
    "CRS": 6,
    "CPP": 4,
    "RRRU": 2,
    "RPSU": 2,
    "PPPU": 1,
    "CCU": 2,
    "CPU": 2,
    "RRRRI": 8,
    "SSRPI": 6,
    "SSPPI": 4,
    "RPPPI": 2,
    "PPPPI": 1,
}
"""Legs, by the letters of `random_machine`, and how many poses joints have at most."""

OPEN = [kinds for kinds in MOST if "U" not in kinds and kinds != "PPPPI"]
"""Those without a closed form."""

SOME = ("RRRR", "RRSP", "CCC", "CLP", "CPP", "RRRU", "CPU", "RRRRI", "RPPPI", "PPPPI")
"""Every closure: in space and in a plane, turning and sliding, of cranks, sliders and both."""


def reached(robot, count, seed=0):
    """Return poses in reach around zero, and their joints."""
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-0.06, 0.06, (4000, robot.freedom))
    poses[:, -1] *= 8.0
    joints = pteron.inverse_kinematics(robot, poses, on_failure="nan")
    inside = ~np.isnan(joints).any(axis=-1)
    assert inside.sum() >= count
    return poses[inside][:count], joints[inside][:count]


def away(robot, found, poses):
    """Return how far the nearest of poses (N, k, m) is from those expected (N, m)."""
    apart = found - poses[:, None]
    if not robot.platform.slides:
        apart[..., -1] = 2.0 * np.sin(0.5 * apart[..., -1])
    return np.nanmin(np.abs(apart).max(axis=-1), axis=-1)


def counts(poses):
    return (~np.isnan(poses).any(axis=-1)).sum(axis=-1)


def well_held(robot, poses):
    measure = pteron.kernels.numeric(robot, "type_ii")(poses)[0]
    return np.abs(measure) > 0.02


@pytest.mark.parametrize("seed", gated(range(2), [0]))
@pytest.mark.parametrize("kinds", gated(MOST, SOME[::2]))
def test_direct_inverts_inverse(kinds, seed):
    robot = random_machine(seed, kinds)
    poses, joints = reached(robot, 200, seed)
    every = pteron.direct_kinematics(robot, joints, all_branches=True)
    own = pteron.direct_kinematics(robot, joints)
    assert every.shape == own.shape == (200, MOST[kinds], robot.freedom)
    held = well_held(robot, poses)
    assert held.sum() > 50
    for found in (every, own):
        assert away(robot, found, poses)[held].max() < 1e-12
        assert away(robot, found, poses).max() < 1e-6
        # NaN comes last, and phi, z, y and x tell the order.
        there = ~np.isnan(found[..., 0])
        assert (there[:, :-1] | ~there[:, 1:]).all()
        steps = np.diff(found[..., -1], axis=-1)
        assert (steps[there[:, 1:]] > -1e-9).all()
    assert (counts(own) <= counts(every)).all()
    back = pteron.inverse_kinematics(robot, own[counts(own) > 0][:, 0])
    turned = np.abs(back - joints[counts(own) > 0])
    assert np.minimum(turned, np.abs(turned - 2.0 * np.pi)).max() < 1e-6
    one = pteron.direct_kinematics(robot, joints[7])
    np.testing.assert_allclose(one, own[7], rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", gated(range(4), [0]))
@pytest.mark.parametrize("kinds", gated(OPEN, SOME[1::2]))
def test_modes_counted_another_way(kinds, seed):
    robot = random_machine(100 + seed, kinds)
    _agree(robot, reached(robot, 3, seed)[1])


@pytest.mark.parametrize("name", gated(["par4", "h4", "3-rrr", "3-prr"], ["h4", "3-rrr"]))
@pytest.mark.parametrize("spread", gated([0.0, 1e-12, 1e-8, 1e-4, 0.3], [0.0, 1e-12, 1e-4]))
def test_modes_where_all_joints_are_nearly_equal(name, spread):
    """The tips then lie in a plane, and differences of closures are singular in p for every phi."""
    robot = pteron.load(name)
    rng = np.random.default_rng(1)
    joints = pteron.inverse_kinematics(robot, pteron.random_poses(robot, 8, seed=rng))
    equal = np.broadcast_to(joints.mean(axis=-1, keepdims=True), joints.shape)
    _agree(robot, equal + spread * rng.normal(size=joints.shape))


def _agree(robot, joints):
    found = pteron.kinematics.assembly.every_pose(robot, joints, closure_of(robot).modes)
    for q, number in zip(joints, counts(found), strict=True):
        # Two modes that are nearer than its samples the search may miss.
        assert any(number == count_modes(robot, q, samples) for samples in (4000, 400_000))


def _ideal(kinds, dimension, slides, rng):
    """Return equations of random closures in rational numbers, and the unknowns."""
    lengths = sympy.symbols("x y z")[:dimension]
    c, s, phi = sympy.symbols("c s phi")

    def drawn():
        return int(rng.integers(-50, 50))

    equations = [] if slides else [c**2 + s**2 - 1]
    for kind in kinds:
        a, b = drawn(), drawn()
        turned = (a * phi, b * phi) if slides else (a * c - b * s, b * c + a * s)
        point = [p + v + drawn() for p, v in zip(lengths, (*turned, 0), strict=False)]
        if kind == "s":
            square = sum((v - drawn()) ** 2 for v in point)
            equations.append(square - int(rng.integers(1, 5000)))
        else:
            equations.append(sum(drawn() * v for v in point) + drawn())
    return equations, (*lengths, *((phi,) if slides else (c, s)))


@pytest.mark.parametrize(
    ("kinds", "slides", "most"),
    [
        ("ssss", False, 8),
        ("sssp", False, 8),
        ("sspp", False, 8),
        ("sppp", False, 4),
        ("sss", False, 6),
        ("ssp", False, 6),
        ("spp", False, 4),
        ("ssss", True, 8),
        ("sssp", True, 6),
        ("sspp", True, 4),
        ("sppp", True, 2),
    ],
)
def test_closures_have_so_many_solutions(kinds, slides, most):
    """A Groebner basis modulo a prime counts them, s for a sphere or circle, p for a plane."""
    rng = np.random.default_rng(0)
    equations, unknowns = _ideal(kinds, len(kinds) - 1, slides, rng)
    basis = sympy.groebner(equations, *unknowns, order="grevlex", modulus=32003)
    leading = [p.monoms(order="grevlex")[0] for p in basis.polys]
    standard = [
        powers
        for powers in product(range(9), repeat=len(unknowns))
        if sum(powers) < 9
        and not any(all(i >= j for i, j in zip(powers, m, strict=True)) for m in leading)
    ]
    assert len(standard) == most


def test_an_h4_has_eight_real_poses_and_a_3_rrr_six():
    for name, most in (("h4", 8), ("3-rrr", 6)):
        robot = pteron.load(name)
        poses = pteron.random_poses(robot, 400, type_i=0.05, type_ii=0.0)
        joints = pteron.inverse_kinematics(robot, poses)
        if name == "h4":
            joints = np.broadcast_to(joints.mean(axis=-1, keepdims=True), joints.shape)
        found = pteron.direct_kinematics(robot, joints, all_branches=True)
        assert counts(found).max() == most


def test_two_modes_meet_and_vanish_together():
    """At the end of a motion two poses become one; rounding must not leave one alone for long."""
    robot = pteron.load("3-prr")
    home = np.array([0.0, 0.0, 0.2])
    start = pteron.inverse_kinematics(robot, home)
    way = np.array([1.0, -0.6, 0.3])
    inside, beyond = 0.0, 1.0
    number = int(
        counts(pteron.direct_kinematics(robot, start, all_branches=True, on_failure="nan"))
    )
    for _ in range(60):
        middle = 0.5 * (inside + beyond)
        poses = pteron.direct_kinematics(
            robot, start + middle * way, all_branches=True, on_failure="nan"
        )
        inside, beyond = (middle, beyond) if counts(poses) >= number else (inside, middle)
    steps = 10.0 ** np.arange(-11.0, -2.0)
    for side, most in ((-1, number), (1, number - 2)):
        joints = start + (inside + side * steps)[:, None] * way
        found = pteron.direct_kinematics(robot, joints, all_branches=True, on_failure="nan")
        assert (counts(found) == most).all()
    joints = start + (inside + np.linspace(-1e-13, 1e-13, 21))[:, None] * way
    found = pteron.direct_kinematics(robot, joints, all_branches=True, on_failure="nan")
    assert set(counts(found)) <= {number - 2, number - 1, number}


def test_modes_that_all_but_meet_are_told_apart():
    """To some 2e-7, as in forty digits."""
    robot = pteron.load("3-prr")
    start, way = pteron.inverse_kinematics(robot, [0.0, 0.0, 0.2]), np.array([1.0, -0.6, 0.3])
    inside, beyond = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (inside + beyond)
        poses = pteron.direct_kinematics(
            robot, start + middle * way, all_branches=True, on_failure="nan"
        )
        inside, beyond = (middle, beyond) if counts(poses) == 2 else (inside, middle)
    mpmath.mp.dps = 40
    apart = []
    for short in (1e-15, 1e-14, 1e-13, 1e-12):
        joints = start + (inside - short) * way
        found = pteron.direct_kinematics(robot, joints, all_branches=True, on_failure="nan")
        found = found[~np.isnan(found[:, 0])]
        assert len(found) == 2
        exact = [exact_pose(robot, joints, pose) for pose in found]
        between = [float(mpmath.norm(mpmath.matrix(a) - mpmath.matrix(b))) for a, b in [exact]]
        np.testing.assert_allclose(
            found, np.array(exact, dtype=float), rtol=0, atol=0.25 * between[0]
        )
        apart += between
    assert apart[0] < 4e-7
    assert apart[0] > 1e-8


def exact_pose(robot, joints, near):
    """Return the pose of planar P-R-R legs' joints next to one, in forty digits."""

    def missed(x, y, phi):
        c, s = mpmath.cos(phi), mpmath.sin(phi)
        found = []
        for leg, q in zip(robot.legs, joints, strict=True):
            ends = [
                mpmath.mpf(float(a)) + mpmath.mpf(float(q)) * mpmath.mpf(float(b))
                for a, b in zip(leg.guide_point, leg.slider_direction, strict=True)
            ]
            a, b = (mpmath.mpf(float(v)) for v in leg.platform_point[:2])
            across = x + c * a - s * b - ends[0], y + s * a + c * b - ends[1]
            found.append(across[0] ** 2 + across[1] ** 2 - mpmath.mpf(leg.lower_length) ** 2)
        return found

    return list(mpmath.findroot(missed, [mpmath.mpf(float(v)) for v in near], tol=1e-60))


def test_what_is_no_number_has_no_pose():
    for name in ("par4", "3-prr"):
        robot = pteron.load(name)
        n = robot.freedom
        wrong = [
            np.full(n, 1e200),
            np.full(n, np.nan),
            [0.1] * (n - 1) + [np.inf],
            np.full(n, 1e40),
        ]
        if name == "3-prr":
            wrong.append([1e6, 0.0, 0.0])
        with pytest.warns(pteron.UnlikelyValue, match="are these"):
            assert np.isnan(pteron.direct_kinematics(robot, wrong, on_failure="nan")).all()
        assert pteron.direct_kinematics(robot, np.zeros((2, 0, n))).shape[:2] == (2, 0)


@CLIENTS
def test_without_a_closed_form_there_is_the_step(tmp_path):
    robot = pteron.load("par4")
    with pytest.raises(ModelError, match='"direct_step" follows the pose from one that is near'):
        pteron.compile(robot, "direct_kinematics")
    header = pteron.export_c(robot, folder=tmp_path)[0].read_text()
    assert "int par4_direct_step(" in header
    assert "direct_kinematics" not in header
    (block,) = pteron.export_st(robot, "direct_kinematics", tmp_path)
    assert block.name == "Par4_DirectStep.st"


@pytest.mark.parametrize("target", ["vm", "c"])
@pytest.mark.parametrize("kinds", gated(["RRRR", "RPPP", "CCC", "RRRU", "PPPP", "RRR"], ["RRRU"]))
def test_a_step_from_a_pose_that_is_near(kinds, target):
    robot = random_machine(0, kinds)
    step = pteron.compile(robot, "direct_step", target)
    poses, joints = reached(robot, 200)
    held = well_held(robot, poses)
    held &= (numeric(robot, "squared_type_i")(poses + 5e-4)[0] >= 0.0).all(axis=-1)
    poses, joints = poses[held], joints[held]
    found, measure, bent = step(joints, poses + 5e-4)
    assert not bent.any()
    np.testing.assert_allclose(found, poses, rtol=0, atol=1e-11)
    expected = np.abs(pteron.compile(robot, "type_ii")(poses))
    np.testing.assert_allclose(np.abs(measure), expected, rtol=1e-6)
    if kinds != "PPPP":  # whose closures are nearly linear
        assert np.isnan(step(joints + 3.0, poses)[0]).any(axis=-1).mean() > 0.8


def test_no_step_is_taken_at_a_singularity():
    """Where two modes of a Quadrupteron meet, and on the other side, whose mode is another."""
    robot = pteron.load("quadrupteron")
    step = pteron.compile(robot, "direct_step")
    pose = np.array([0.01, 0.02, 0.03, 0.0])
    joints = pteron.inverse_kinematics(robot, pose)
    found, measure, _ = step(joints, [0.0, 0.0, 0.0, 0.5])
    np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)
    other, opposite, _ = step(joints, [0.0, 0.0, 0.0, 2.5])
    np.testing.assert_allclose(other, [0.01, 0.02, 0.03, np.pi], rtol=0, atol=1e-12)
    assert measure * opposite < 0.0
    edge = np.array([0.0, 0.0, 0.0, 0.5 * np.pi])
    assert not np.isfinite(step(pteron.inverse_kinematics(robot, edge), edge)[0]).all()


SIDES = {
    **{name: CATALOG[name] for name in ("delta", "five-bar", "par4", "orthoglide", "quadrupteron")},
    **{kinds: random_machine(0, kinds) for kinds in ("RPPP", "CCC", "RRRU", "SSS")},
}


@pytest.mark.parametrize("share", gated([0.1, 1.0], [1.0]))
@pytest.mark.parametrize("name", SIDES)
def test_a_step_stays_on_its_side_of_all_singularities(name, share):
    """From anywhere in reach, a tenth of the way to another pose, and all of it."""
    robot = SIDES[name]
    everywhere = {"type_i": 0.0, "type_ii": 0.0, "limits": False}
    start, end = pteron.random_poses(robot, 2000, seed=5, **everywhere).reshape(2, 1000, -1)
    end = start + share * (end - start)
    reached = (numeric(robot, "squared_type_i")(end)[0] >= 0.0).all(axis=-1)
    start, end = start[reached], end[reached]
    joints = pteron.inverse_kinematics(robot, end)
    found, _, bent = pteron.compile(robot, "direct_step")(joints, start)
    came = np.isfinite(found).all(axis=-1)
    assert came.any()
    assert not bent[came].any()
    own = pteron.inverse_kinematics(robot, found[came])
    away = own - joints[came]
    turns = np.where([leg.goes_round for leg in robot.legs], np.round(away / (2.0 * np.pi)), 0.0)
    assert np.abs(away - 2.0 * np.pi * turns).max() < 1e-6
    sides = [numeric(robot, "type_ii")(poses)[0] for poses in (start[came], found[came])]
    assert (sides[0] * sides[1] > 0.0).all()
    if (name, share) == ("delta", 0.1):  # whose steps all converge: NaN leads to the other side
        sides = [numeric(robot, "type_ii")(poses)[0] for poses in (start, end)]
        np.testing.assert_array_equal(came, sides[0] * sides[1] > 0.0)
        assert not came.all()


def test_a_step_over_a_singularity_is_told():
    """Measured with the joints to come the start seems to lie on the other side."""
    robot = CATALOG["five-bar"]
    start = np.array([-0.00645167584305894, -0.1628013106639689])
    joints = np.array([-0.8483849165790605, -2.294662569722324])
    found, measure, bent = pteron.compile(robot, "direct_step")(joints, start)
    assert np.isnan(found).all()
    assert measure > 0.0 > numeric(robot, "type_ii")(start)[0]
    assert bent == 0.0


def test_the_leg_that_a_step_bends_the_other_way_is_named():
    robot = CATALOG["linear-delta"]
    pose = pteron.workspace.home_pose(robot)
    turned = with_elbows(robot, "--+")
    joints = pteron.inverse_kinematics(turned, pose)
    found, _, bent = pteron.compile(robot, "direct_step")(joints, pose)
    assert np.isnan(found).all()
    assert bent == 3.0
    found, _, bent = pteron.compile(turned, "direct_step")(joints, pose)
    np.testing.assert_allclose(found, pose, rtol=0, atol=1e-12)
    assert bent == 0.0


@pytest.mark.parametrize(
    "name",
    gated(
        ["par4", "h4", "3-rrr", "3-prr", "delta", "five-bar", "delta-4"],
        ["h4", "3-rrr", "delta", "five-bar", "delta-4"],
    ),
)
def test_a_motion_is_followed_through_home(name):
    """At home all joints are equal, or nearly, and the tips in a plane."""
    robot = pteron.load(name)
    home = pteron.workspace.home_pose(robot)
    to = pteron.random_poses(robot, 1, type_i=0.3)[0]
    poses = home + np.linspace(-0.2, 0.2, 401)[:, None] * (to - home)
    joints = pteron.inverse_kinematics(robot, poses)
    np.testing.assert_allclose(pteron.follow(robot, joints, poses[0]), poses, rtol=0, atol=1e-12)
    # From a pose of another place, and with samples far apart, halving the way.
    few = pteron.follow(robot, joints[::40], home)
    np.testing.assert_allclose(few, poses[::40], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("name", "leg"), [("quadrupteron", 1), ("tripteron", 0)])
def test_one_joint_is_followed_from_the_origin(name, leg):
    """Of a leg whose plane stays in the origin all terms are zero, but for rounding."""
    robot = pteron.load(name)
    joints = np.zeros((9, robot.freedom))
    joints[:, leg] = np.linspace(0.0, 0.02, 9)
    poses = pteron.follow(robot, joints, np.zeros(robot.freedom))
    np.testing.assert_allclose(pteron.inverse_kinematics(robot, poses), joints, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", gated(["par4", "h4", "3-rrr", "delta"], ["3-rrr", "delta"]))
def test_far_samples_are_followed_as_near_ones_are(name):
    robot = pteron.load(name)
    ends = pteron.random_poses(robot, 60, type_i=0.1, type_ii=0.02, seed=3)
    ended = 0
    for start, end in zip(ends[:30], ends[30:], strict=True):
        first, last = pteron.inverse_kinematics(robot, [start, end])
        near, far = (first + np.linspace(0, 1, n)[:, None] * (last - first) for n in (1951, 40))
        found = pteron.follow(robot, far, start, on_failure="nan")
        expected = pteron.follow(robot, near, start, on_failure="nan")[::50]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
        ended += np.isnan(found).any()
    assert 0 < ended < 30


def test_a_motion_beyond_its_mode_is_told():
    robot = pteron.load("3-prr")
    start = pteron.inverse_kinematics(robot, [0.0, 0.0, 0.0])
    joints = start + np.linspace(0.0, 2.0, 50)[:, None]
    lost = int(np.isnan(pteron.follow(robot, joints, np.zeros(3), on_failure="nan")[:, 0]).argmax())
    assert lost > 0
    with pytest.raises(UnreachablePose, match=rf"joints\[{lost}\]: the platform does not follow"):
        pteron.follow(robot, joints, np.zeros(3))
    with pytest.raises(DataError, match=r"\(N, 3\) and \(3,\) expected"):
        pteron.follow(robot, start, np.zeros(3))


@pytest.mark.parametrize("name", ["quadrupteron", "tripteron"])
def test_a_motion_ends_where_a_leg_does_not_reach(name):
    """A leg's plane goes on, where its links do not."""
    robot = pteron.load(name)
    start = np.zeros(robot.freedom)
    along_x = pteron.jacobian(robot, start)[:, 0]
    joints = pteron.inverse_kinematics(robot, start) + np.linspace(0, 0.4, 41)[:, None] * along_x
    found = pteron.follow(robot, joints, start, on_failure="nan")
    lost = np.isnan(pteron.direct_kinematics(robot, joints, on_failure="nan")[:, 0, 0])
    np.testing.assert_array_equal(np.isnan(found[:, 0]), lost)
    assert 0 < lost.sum() < 41
    with pytest.raises(UnreachablePose, match="the platform does not follow"):
        pteron.follow(robot, joints, start)


@pytest.mark.parametrize("away", [1e-2, 1e-3, 1e-4])
def test_poses_next_to_parallel_rods_are_found(away):
    """Rods 3 and 4 of one side, whose cranks have nearly one angle: their spheres all but agree."""
    robot = pteron.load("par4")
    singular = np.array([0.21319231, -0.46344404, -0.24188617, -0.17646013])
    pose = singular + away * np.array([-0.0780375, -0.02449757, -0.02217865, 0.99640259])
    joints = pteron.inverse_kinematics(robot, pose)
    found = pteron.direct_kinematics(robot, joints)
    assert np.isfinite(found[:, 0]).sum() == 2
    # The type-II measure falls with the square of the distance, and as many digits are lost.
    assert np.nanmin(np.abs(found - pose).max(axis=-1)) < 1e-14 / away**2


def test_which_modes_a_pose_is_in():
    robot = pteron.load("par4")
    poses = pteron.random_poses(robot, 50)
    joints = pteron.inverse_kinematics(robot, poses)
    for branches in (False, True):
        found = pteron.direct_kinematics(robot, joints, all_branches=branches)
        mode = pteron.kinematics.assembly_mode(robot, poses, all_branches=branches)
        np.testing.assert_allclose(found[np.arange(50), mode], poses, rtol=0, atol=1e-11)
    elbows = pteron.kinematics.working_mode(robot, found, joints[:, None])
    there = ~np.isnan(found[..., 0])
    assert (elbows[there] != 0).all()
    own = [leg.elbow for leg in robot.legs]
    assert (pteron.kinematics.working_mode(robot, poses, joints) == own).all()
    for mode in pteron.working_modes(robot):
        signs = [leg.elbow for leg in mode.legs]
        in_it = there & (elbows == signs).all(axis=-1)
        back = pteron.inverse_kinematics(mode, found[in_it])
        expected = np.broadcast_to(joints[:, None], found.shape)[in_it]
        np.testing.assert_allclose(back, expected, rtol=0, atol=1e-6)
    assert (pteron.kinematics.working_mode(robot, poses, joints + 0.3) == 0).all()


def test_elbows_that_joints_do_not_tell_are_the_robots_own():
    robot = pteron.load("quadrupteron")
    joints = pteron.inverse_kinematics(robot, np.zeros(4))
    assert pteron.kinematics.working_mode(robot, np.zeros(4), joints).tolist() == [
        leg.elbow for leg in robot.legs
    ]

"""What cannot be served: which error, what it says, and NaN in its place where asked for."""

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CATALOG, states

import pteron
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose
from pteron.kinematics import SINGULAR, usable_poses

ROBOT = CATALOG["quadrupteron"]
LOOSE = np.array([0.01, 0.02, -0.01, np.pi / 2])
"""A type-II singularity, in reach."""


def along_leg_1(length):
    """Return the pose at phi = 0 in which R1 and R3 of leg 1 are `length` apart, along y."""
    leg = ROBOT.legs[0]
    return np.array([0.0, leg.guide_point[1] + length - leg.platform_point[1], 0.0, 0.0])


LONGEST = ROBOT.legs[0].upper_length + ROBOT.legs[0].lower_length
FAR = along_leg_1(LONGEST + 0.001)
"""Out of reach of leg 1 by a millimetre, in reach of the others."""
STRETCHED = along_leg_1(LONGEST)

CALLS = {
    "inverse_kinematics": (pteron.inverse_kinematics, 0),
    "link_vectors": (pteron.link_vectors, 0),
    "potential_energy": (pteron.potential_energy, 0),
    "link_jacobians": (pteron.link_jacobians, 0),
    "joint_screws": (pteron.joint_screws, 0),
    "joint_rates": (pteron.joint_rates, 1),
    "joint_accelerations": (pteron.joint_rates, 2),
    "mass_matrix": (pteron.mass_matrix, 0),
    "coriolis_matrix": (pteron.coriolis_matrix, 1),
    "bias_forces": (pteron.bias_forces, 1),
    "gravity_forces": (pteron.gravity_forces, 0),
    "kinetic_energy": (pteron.kinetic_energy, 1),
    "forward_dynamics": (pteron.forward_dynamics, 2),
    "forward_dynamics, wrench": (pteron.forward_dynamics, 3),
    "inverse_dynamics": (pteron.inverse_dynamics, 2),
    "inverse_dynamics, wrench": (pteron.inverse_dynamics, 3),
    "regressor": (pteron.regressor, 2),
}
"""Each public function of poses that depends on reach, and how many arrays (..., m) follow."""

REACH_ONLY = {"inverse_kinematics", "link_vectors", "potential_energy"}
"""Those that a stretched leg does not trouble."""
NEED_J = {"inverse_dynamics", "inverse_dynamics, wrench", "regressor"}
"""Those that a type-II singularity troubles."""


def arrays(name, poses):
    """Return what follows the pose in a call: random numbers, the same each time."""
    return list(np.random.default_rng(0).normal(size=(CALLS[name][1], *np.shape(poses))))


def call(name, robot, poses, *others, **options):
    """Return the arrays that a function of CALLS returns."""
    found = CALLS[name][0](robot, poses, *(others or arrays(name, poses)), **options)
    return flat(found)


def flat(found):
    if isinstance(found, pteron.JointMotion):
        return [found.sliders, found.upper_links, found.lower_links, found.revolute]
    if isinstance(found, tuple):
        return [array for part in found for array in flat(part)]
    return [np.asarray(found)]


EVERY = pytest.mark.parametrize("name", CALLS)


@EVERY
def test_an_unreachable_pose_names_leg_shortfall_and_index(name):
    poses = states(ROBOT, 20)[0].copy()
    poses[17] = FAR
    with pytest.raises(UnreachablePose) as caught:
        call(name, ROBOT, poses)
    error = caught.value
    assert isinstance(error, PteronError)
    assert (error.leg, error.index) == (1, (17,))
    assert error.shortfall == pytest.approx(0.001, rel=1e-12)
    assert str(error) == (
        "pose[17]: leg 1 misses it by 0.001 m: its links span 0.02 to 0.426 m, but the platform "
        "point is 0.427 m from R1; move the pose towards the legs' reach"
    )


def test_a_pose_too_near_is_unreachable_too():
    shortest = ROBOT.legs[0].lower_length - ROBOT.legs[0].upper_length
    robot = replace(ROBOT, legs=(ROBOT.legs[0], *(longer(leg) for leg in ROBOT.legs[1:])))
    with pytest.raises(UnreachablePose, match=r"^pose: leg 1 misses it by 0.005 m") as caught:
        pteron.inverse_kinematics(robot, along_leg_1(shortest - 0.005))
    assert caught.value.index == ()
    assert caught.value.shortfall == pytest.approx(0.005, rel=1e-12)


def longer(leg):
    return replace(leg, upper_length=0.5, lower_length=0.5)


def test_the_first_of_several_poses_is_named_and_the_others_counted():
    poses = states(ROBOT, 12)[0].reshape(3, 4, 4).copy()
    poses[1, 2], poses[2, 0] = FAR, along_leg_1(0.5)
    with pytest.raises(UnreachablePose, match=r"^pose\[1, 2\]: .*\(2 such poses in the batch\)"):
        pteron.inverse_kinematics(ROBOT, poses)


def test_a_shortfall_is_that_of_the_leg_in_space():
    robot = CATALOG["quadrupteron-oblique"]
    pose = states(robot, 1)[0][0] + np.array([0.4, 0.3, -0.2, 0.0])
    with pytest.raises(UnreachablePose) as caught:
        pteron.inverse_kinematics(robot, pose)
    leg = robot.legs[caught.value.leg - 1]
    k = np.array(robot.platform.axis)
    x, _, z = np.array(robot.platform.frame)
    sx, sy, sz = leg.platform_point
    across = np.cos(pose[3]) * x + np.sin(pose[3]) * np.cross(k, x)
    c = pose[:3] + sx * across + sy * np.cross(k, across) + sz * z
    d, e = np.array(leg.direction), np.array(leg.e)
    u = c - np.array(leg.guide_point)
    u -= (d @ u) / (d @ e) * e
    miss = np.linalg.norm(u) - leg.upper_length - leg.lower_length
    assert miss > 0
    assert caught.value.shortfall == pytest.approx(miss, rel=1e-12)


@EVERY
def test_a_leg_exactly_stretched_is_singular_of_type_1(name):
    if name in REACH_ONLY:
        assert all(np.isfinite(a).all() for a in call(name, ROBOT, STRETCHED))
        return
    with pytest.raises(SingularPose, match=r"^pose: singular for leg 1: it is stretched") as caught:
        call(name, ROBOT, STRETCHED)
    assert (caught.value.kind, caught.value.index) == ("I", ())
    assert 0.0 <= caught.value.closeness <= SINGULAR
    assert "move away from the edge of its reach" in str(caught.value)


def test_a_leg_just_bent_is_served():
    pose = along_leg_1(LONGEST - 1e-6)
    assert np.isfinite(pteron.inverse_dynamics(ROBOT, pose, np.zeros(4), np.zeros(4))).all()


def test_a_leg_exactly_folded_is_singular_of_type_1():
    legs = [replace(leg, upper_length=0.5, lower_length=0.5) for leg in ROBOT.legs]
    legs[0] = replace(
        ROBOT.legs[0], upper_length=0.125, lower_length=0.25, guide_point=(0, -0.5, 0)
    )
    legs[0] = replace(legs[0], platform_point=(0.0, 0.0, 0.0))
    robot = replace(ROBOT, legs=tuple(legs))
    with pytest.raises(SingularPose, match="stretched or folded") as caught:
        pteron.mass_matrix(robot, [0.0, -0.375, 0.0, 0.0])
    assert (caught.value.kind, caught.value.closeness) == ("I", 0.0)


@EVERY
@pytest.mark.parametrize("sign", [1, -1])
def test_a_singular_orientation_is_of_type_2(name, sign):
    pose = LOOSE * [1, 1, 1, sign]
    if name not in NEED_J:
        assert all(np.isfinite(a).all() for a in call(name, ROBOT, pose))
        return
    degrees = 90 * sign
    words = rf"^pose: singular orientation \(type II\), .* phi = {degrees} deg\); turn away"
    with pytest.raises(SingularPose, match=words.replace(" phi", r".*\(phi")) as caught:
        call(name, ROBOT, pose)
    assert (caught.value.kind, caught.value.index) == ("II", ())
    assert 0.0 <= caught.value.closeness < 1e-15


def test_closeness_is_the_angle_from_the_singular_orientation():
    pose = LOOSE + np.array([0, 0, 0, SINGULAR / 2])
    with pytest.raises(SingularPose) as caught:
        pteron.inverse_dynamics(ROBOT, pose, np.zeros(4), np.zeros(4))
    # The sum of pi / 2 and 5e-10 is rounded to 2e-16.
    assert caught.value.closeness == pytest.approx(SINGULAR / 2, rel=1e-6)
    pose = LOOSE + np.array([0, 0, 0, 2 * SINGULAR])
    assert np.isfinite(pteron.inverse_dynamics(ROBOT, pose, np.zeros(4), np.zeros(4))).all()


def test_forces_keep_half_of_their_digits_next_to_a_singular_orientation():
    closeness = 1e-8
    pose = LOOSE + np.array([0, 0, 0, closeness])
    velocity, acceleration = np.random.default_rng(0).normal(size=(2, 4))
    forces = pteron.inverse_dynamics(ROBOT, pose, velocity, acceleration)
    # One force grows as 1 / closeness, its share lost to rounding with it.
    there = pteron.forward_dynamics(ROBOT, pose, velocity, forces)
    np.testing.assert_allclose(there, acceleration, rtol=0, atol=1e-16 / closeness * 1e2)
    with pytest.raises(SingularPose):
        pteron.inverse_dynamics(ROBOT, LOOSE + pose / 1e10, velocity, acceleration)


def undetermined():
    """Return a machine, and poses in which R1 and R3 of leg 3, whose links are equal, coincide."""
    legs = [longer(leg) for leg in ROBOT.legs]
    legs[2] = ROBOT.legs[2]
    assert legs[2].upper_length == legs[2].lower_length
    on_guide = np.array(legs[2].guide_point) - legs[2].platform_point
    poses = [[*on_guide, 0.0], [*(on_guide + np.array([0.1, 0, 0])), 0.0]]
    return replace(ROBOT, legs=tuple(legs)), poses


@pytest.mark.parametrize("index", [0, 1])
@EVERY
def test_an_undetermined_elbow_is_refused(name, index):
    robot, poses = undetermined()
    with pytest.raises(SingularPose, match=r"^pose: .* leg 3: R1 and R3 coincide") as caught:
        call(name, robot, poses[index])
    assert (caught.value.kind, caught.value.index, caught.value.closeness) == ("elbow", (), 0.0)


@pytest.mark.parametrize("name", CALLS)
def test_an_undetermined_elbow_is_nan_where_asked(name):
    robot, poses = undetermined()
    with np.errstate(all="raise"):
        found = call(name, robot, [*poses, np.zeros(4)], on_failure="nan")
    for part in found:
        assert np.isnan(part[:2]).all()
        assert np.isfinite(part[2]).all()


@EVERY
@pytest.mark.parametrize("offset", [1e-13, 1e-10])
def test_an_elbow_is_undetermined_to_rounding_and_no_further(name, offset):
    robot, poses = undetermined()
    pose = poses[0] + np.array([0.0, offset, 0.0, 0.0])
    if name in REACH_ONLY and offset > 1e-12:
        assert all(np.isfinite(a).all() for a in call(name, robot, pose))
        return
    with pytest.raises(SingularPose, match="leg 3") as caught:
        call(name, robot, pose)
    assert caught.value.kind == ("elbow" if offset < 1e-12 else "I")
    assert caught.value.closeness == pytest.approx(offset / ROBOT.legs[2].upper_length, rel=1e-2)


@EVERY
def test_failures_in_batches_of_every_shape(name):
    good = states(ROBOT, 15)[0].reshape(3, 5, 4)
    others = arrays(name, good)
    expected = call(name, ROBOT, good, *others)
    for bad in (FAR, [0.0, np.nan, 0.0, 0.0], [0.0, 0.0, 0.0, np.inf]):
        poses = good.copy()
        poses[1, 3] = bad
        with np.errstate(all="raise"):
            found = call(name, ROBOT, poses, *others, on_failure="nan")
            single = call(name, ROBOT, bad, *(a[1, 3] for a in others), on_failure="nan")
        for after, before, alone in zip(found, expected, single, strict=True):
            assert np.isnan(after[1, 3]).all()
            assert alone.shape == before.shape[2:]
            assert np.isnan(alone).all()
            after[1, 3] = before[1, 3]
            np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize("name", CALLS)
def test_nan_in_the_failing_rows_and_the_same_numbers_elsewhere(name):
    poses = states(ROBOT, 300)[0].copy()
    others = arrays(name, poses)
    expected = call(name, ROBOT, poses, *others)
    bad = {3: FAR, 17: STRETCHED, 100: LOOSE, 200: poses[200] + 9.0}
    for i, pose in bad.items():
        poses[i] = pose
    poses[250, 2], poses[260, 3], poses[270] = np.nan, np.inf, -np.inf
    failing = {3, 200, 250, 260, 270}
    failing |= set() if name in REACH_ONLY else {17}
    failing |= {100} if name in NEED_J else set()
    served = set(bad) - failing
    with np.errstate(all="raise"):
        found = call(name, ROBOT, poses, *others, on_failure="nan")
    same = [i for i in range(300) if i not in failing | served]
    for after, before in zip(found, expected, strict=True):
        assert np.isnan(after[sorted(failing)]).all()
        assert np.isfinite(after[sorted(served)]).all()
        np.testing.assert_array_equal(after[same], before[same])


@pytest.mark.parametrize(
    ("name", "k", "value"),
    [
        (name, k, value)
        for name, (_, more) in CALLS.items()
        for k in range(more)
        for value in ("nan", "inf")
    ],
)
def test_nan_in_any_argument_ends_in_its_own_row(name, k, value):
    poses = states(ROBOT, 5)[0]
    others = arrays(name, poses)
    expected = call(name, ROBOT, poses, *others)
    spoilt = [a.copy() for a in others]
    spoilt[k][2, 1] = float(value)
    with np.errstate(all="raise"):
        found = call(name, ROBOT, poses, *spoilt, on_failure="nan")
    rows = [0, 1, 3, 4]
    for i, (after, before) in enumerate(zip(found, expected, strict=True)):
        np.testing.assert_array_equal(after[rows], before[rows])
        if name == "joint_accelerations" and k == 1 and i < 4:
            np.testing.assert_array_equal(after, before, "rates do not see accelerations")
        else:
            assert np.isnan(after[2]).all()


@EVERY
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_its_index(name, value):
    poses = states(ROBOT, 6)[0]
    names = ["pose", *argument_names(name)]
    values = [poses, *arrays(name, poses)]
    for k, argument in enumerate(names):
        spoilt = [a.copy() for a in values]
        spoilt[k][4, 2] = value
        with pytest.raises(DataError) as caught:
            call(name, ROBOT, *spoilt)
        assert str(caught.value) == f"{argument}[4, 2]: {value} given, a finite number expected"
        single = [a[4] for a in spoilt]
        with pytest.raises(DataError) as caught:
            call(name, ROBOT, *single)
        assert str(caught.value) == f"{argument}[2]: {value} given, a finite number expected"


def argument_names(name):
    third = "forces" if name.startswith("forward") else "acceleration"
    return ["velocity", third, "wrench"][: CALLS[name][1]]


@EVERY
def test_a_wrong_shape_is_refused_with_what_was_expected(name):
    poses = states(ROBOT, 6)[0]
    names = ["pose", *argument_names(name)]
    values = [poses, *arrays(name, poses)]
    for k, argument in enumerate(names):
        for wrong, shown in ((values[k][:, :3], "(6, 3)"), (1.0, "()"), ([], "(0,)")):
            given = [*values[:k], wrong, *values[k + 1 :]]
            with pytest.raises(DataError) as caught:
                flat(CALLS[name][0](ROBOT, *given))
            assert str(caught.value) == f"{argument}: shape {shown} given, (..., 4) expected"
        for wrong in ("text", ["1", "2", "3", "4"], [1j, 0, 0, 0], [[1, 2, 3, 4], [1]], {"x": 1}):
            given = [*values[:k], wrong, *values[k + 1 :]]
            with pytest.raises(DataError, match=f"^{argument}: not an array of real numbers$"):
                CALLS[name][0](ROBOT, *given)


@pytest.mark.parametrize("name", [name for name, (_, more) in CALLS.items() if more])
def test_leading_axes_that_do_not_broadcast_are_named(name):
    poses = states(ROBOT, 6)[0]
    values = [poses[:5], *arrays(name, poses)]
    with pytest.raises(DataError, match=r"leading axes do not broadcast: pose \(5,\), velocity"):
        CALLS[name][0](ROBOT, *values)


@EVERY
@pytest.mark.parametrize("choice", ["ignore", "", None, "NaN"])
def test_an_unknown_choice_on_failure_is_refused(name, choice):
    pose = states(ROBOT, 1)[0][0]
    with pytest.raises(DataError) as caught:
        call(name, ROBOT, pose, on_failure=choice)
    assert str(caught.value) == f'on_failure: {choice!r} is neither "raise" nor "nan"'


def test_the_jacobian_is_given_out_of_reach_and_at_singularities():
    for pose in (FAR, STRETCHED, LOOSE):
        assert np.isfinite(pteron.jacobian(ROBOT, pose)).all()
    with pytest.raises(DataError, match=r"pose\[0\]: nan given"):
        pteron.jacobian(ROBOT, [np.nan, 0, 0, 0])
    with pytest.raises(DataError, match=r"pose: shape \(3,\) given"):
        pteron.jacobian(ROBOT, np.zeros(3))
    lost = pteron.jacobian(ROBOT, [[np.nan, 0, 0, 0], [0, 0, 0, 0]], on_failure="nan")
    assert np.isnan(lost[0]).all()
    assert np.isfinite(lost[1]).all()


def test_usable_poses_asks_only_for_what_it_is_told():
    poses = np.array([FAR, STRETCHED, LOOSE, [0, 0, 0, 0]])
    expected = {
        (): [],
        ("reach",): [0],
        ("bent",): [0, 1],
        ("held",): [2],
        ("reach", "held"): [0, 2],
        ("bent", "held"): [0, 1, 2],
    }
    for needs, lost in expected.items():
        wanted = dict.fromkeys(needs, True)
        found = usable_poses(ROBOT, poses, on_failure="nan", **wanted)
        assert np.flatnonzero(np.isnan(found).all(axis=-1)).tolist() == lost
        kept = [i for i in range(4) if i not in lost]
        np.testing.assert_array_equal(found[kept], poses[kept])


# Direct kinematics: a mode that is not real is NaN, by default.


def impossible():
    """Return sliders that no pose has: legs 2 and 4, along y, are a metre apart."""
    return pteron.inverse_kinematics(ROBOT, np.zeros(4)) + np.array([0, 0.5, 0, -0.5])


def test_direct_kinematics_gives_nan_by_default():
    with np.errstate(all="raise"):
        assert np.isnan(pteron.direct_kinematics(ROBOT, impossible())).all()
        found = pteron.direct_kinematics(ROBOT, [impossible(), np.zeros(4), [np.nan, 0, 0, np.inf]])
    assert np.isfinite(found[1]).any()
    assert np.isnan(found[[0, 2]]).all()


def test_direct_kinematics_raises_where_asked():
    sliders = pteron.inverse_kinematics(ROBOT, states(ROBOT, 20)[0])
    np.testing.assert_array_equal(
        pteron.direct_kinematics(ROBOT, sliders, on_failure="raise"),
        pteron.direct_kinematics(ROBOT, sliders),
    )
    sliders[17] = impossible()
    with pytest.raises(UnreachablePose, match=r"^sliders\[17\]: no pose has these") as caught:
        pteron.direct_kinematics(ROBOT, sliders, on_failure="raise")
    assert caught.value.index == (17,)
    with pytest.raises(UnreachablePose, match=r"^sliders: no pose has these") as caught:
        pteron.direct_kinematics(ROBOT, impossible(), on_failure="raise")
    assert caught.value.index == ()
    with pytest.raises(DataError, match=r"^sliders\[1\]: nan given, a finite number expected"):
        pteron.direct_kinematics(ROBOT, [0, np.nan, 0, 0], on_failure="raise")


def test_direct_kinematics_refuses_wrong_shapes():
    with pytest.raises(DataError, match=r"^sliders: shape \(3,\) given, \(..., 4\) expected"):
        pteron.direct_kinematics(ROBOT, np.zeros(3))


@pytest.mark.parametrize("choice", ["ignore", None])
def test_direct_kinematics_refuses_unknown_choices(choice):
    with pytest.raises(DataError, match='is neither "raise" nor "nan"'):
        pteron.direct_kinematics(ROBOT, np.zeros(4), on_failure=choice)

"""What cannot be served: which error, what it says, and NaN in its place where asked for."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import CATALOG, states

import pteron
from pteron.errors import DataError, PteronError, SingularPose, UnreachablePose

ROBOT, DELTA = CATALOG["quadrupteron"], CATALOG["delta"]
LOOSE = np.array([0.01, 0.02, -0.01, np.pi / 2])
"""A type-II singularity, in reach."""


def along_leg_1(length):
    """Return the pose at phi = 0 in which R1 and R3 of leg 1 are `length` apart, along y."""
    leg = ROBOT.legs[0]
    return np.array([0.0, leg.guide_point[1] + length - leg.platform_point[1], 0.0, 0.0])


LONGEST = ROBOT.legs[0].upper_length + ROBOT.legs[0].lower_length
FAR = along_leg_1(LONGEST + 0.001)
"""Out of reach of leg 1 by a millimetre, in reach of the others."""
STRETCHED = along_leg_1(LONGEST * (1 - 1e-9))
"""The sine between the links is 4.5e-5."""

CALLS = {
    "inverse_kinematics": (pteron.inverse_kinematics, 0),
    "link_vectors": (pteron.kinematics.link_vectors, 0),
    "potential_energy": (pteron.potential_energy, 0),
    "link_jacobians": (pteron.kinematics.link_jacobians, 0),
    "joint_screws": (pteron.kinematics.joint_screws, 0),
    "joint_rates": (pteron.kinematics.joint_rates, 1),
    "joint_accelerations": (pteron.kinematics.joint_accelerations, 2),
    "mass_matrix": (pteron.mass_matrix, 0),
    "coriolis_matrix": (pteron.coriolis_matrix, 1),
    "bias_forces": (pteron.bias_forces, 1),
    "gravity_forces": (pteron.gravity_forces, 0),
    "kinetic_energy": (pteron.kinetic_energy, 1),
    "forward_dynamics": (pteron.forward_dynamics, 3),
    "inverse_dynamics": (pteron.inverse_dynamics, 3),
    "regressor": (pteron.regressor, 2),
}
"""Each public function of poses that depends on reach, and how many arrays (..., m) follow."""

REACH_ONLY = {"inverse_kinematics", "link_vectors", "potential_energy"}
"""Those that a stretched leg does not trouble."""
NEED_J = {"inverse_dynamics", "regressor"}
"""Those that a type-II singularity troubles."""


def arrays(name, poses):
    """Return what follows the pose in a call: random numbers, the same each time."""
    return list(np.random.default_rng(0).normal(size=(CALLS[name][1], *np.shape(poses))))


def call(name, robot, poses, *others, **options):
    """Return the arrays that a function of CALLS returns."""
    found = CALLS[name][0](robot, poses, *(others or arrays(name, poses)), **options)
    if isinstance(found, pteron.kinematics.JointMotion):
        return list(vars(found).values())
    return list(found) if isinstance(found, tuple) else [np.asarray(found)]


EVERY = pytest.mark.parametrize("name", CALLS)


# One pose.


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
        "pose[17]: leg 1 misses it by 0.001 m: its links span 0.02 to 0.426 m across direction; "
        "move the pose towards the legs' reach"
    )


def test_an_error_crosses_to_another_process_whole():
    robot = pteron.load("delta")
    with pytest.raises(pteron.UnreachablePose) as caught:
        pteron.inverse_kinematics(robot, [5.0, 0.0, 0.0])
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is pteron.UnreachablePose
    assert str(again) == str(caught.value)
    assert vars(again) == vars(caught.value)


def test_a_crank_that_does_not_reach_says_what_rod_and_crank_span():
    with pytest.raises(UnreachablePose) as caught:
        pteron.inverse_kinematics(DELTA, [0.0, 0.0, -1.5])
    # The crank's tip is 0.33 + 0.42 m from the axis at best, the platform's point 0.125 m.
    miss = np.hypot(0.33 - 0.125, 1.5) - 0.42 - 1.055
    assert caught.value.shortfall == pytest.approx(miss, rel=1e-12)
    assert str(caught.value) == (
        f"pose: leg 1 misses it by {miss:.3g} m: its rod of 1.055 m starts from the circle of a "
        "crank of 0.42 m; move the pose towards the legs' reach"
    )


@pytest.mark.parametrize("robot", [ROBOT, DELTA], ids=lambda robot: robot.name)
def test_millimetres_are_asked_about(robot):
    with pytest.raises(UnreachablePose, match="is it in millimetres\\? lengths are in metres"):
        pteron.inverse_kinematics(robot, [10.0, 20.0, -900.0, 0.0][: robot.freedom])


def test_millimetres_are_asked_about_where_a_motion_begins_near_zero():
    motion = np.linspace([0.0, 0.0, 0.0, 0.0], [60.0, 0.0, 0.0, 0.0], 1001)
    with pytest.raises(UnreachablePose, match="is it in millimetres\\? lengths are") as caught:
        pteron.inverse_kinematics(ROBOT, motion)
    assert caught.value.shortfall < 0.1


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


@EVERY
def test_a_leg_nearly_stretched_is_singular_of_type_1(name):
    if name in REACH_ONLY:
        assert all(np.isfinite(a).all() for a in call(name, ROBOT, STRETCHED))
        return
    with pytest.raises(SingularPose, match=r"^pose: singular for leg 1: it is stretched") as caught:
        call(name, ROBOT, STRETCHED)
    assert (caught.value.kind, caught.value.leg, caught.value.index) == ("I", 1, ())
    assert caught.value.measure == pytest.approx(
        np.sqrt(2e-9 * LONGEST**2 / 0.203 / 0.223), rel=1e-5
    )
    assert "less than six digits are left below 1e-04); move away from the edge" in str(
        caught.value
    )


def test_forces_keep_six_digits_wherever_they_are_given():
    """A stretched leg magnifies rounding by the square of its measure: near the edge no answer."""
    velocity, acceleration = np.random.default_rng(0).normal(size=(2, 4))
    served = 0
    for gap in np.logspace(-16, -6, 200):
        pose = along_leg_1(LONGEST * (1 - gap))
        near = np.nextafter(pose, 0.0)
        forces, others = (
            pteron.inverse_dynamics(ROBOT, x, velocity, acceleration, on_failure="nan")
            for x in (pose, near)
        )
        if np.isfinite(forces).all():
            served += 1
            np.testing.assert_allclose(forces, others, rtol=1e-6)
    assert 0 < served < 100
    # Answered with 1e27 N by a guard that looked at 1e-9 alone; what is computed of it is rounding.
    review = [-0.0551590827704, 0.01, -0.153337794327, 0.0]
    for nudge in np.linspace(-1e-13, 1e-13, 21):
        pose = np.array(review) + nudge * np.array([1, 0, 1, 0])
        with pytest.raises((SingularPose, UnreachablePose), match="leg 4"):
            pteron.inverse_dynamics(ROBOT, pose, [0.1, 0, 0, 0], np.zeros(4))


def test_a_crank_and_rod_in_line_are_singular_of_type_1():
    """The row of J depends on the pose here, so that J itself is refused."""
    robot = replace(
        DELTA, legs=tuple(replace(leg, guide_point=leg.platform_point) for leg in DELTA.legs)
    )
    edge = [0.0, 0.0, -(0.42 + 1.055) * (1 - 1e-10)]
    for function in (pteron.jacobian, pteron.mass_matrix):
        with pytest.raises(
            SingularPose, match="pose: singular for leg 1: it is stretched"
        ) as caught:
            function(robot, edge)
        assert caught.value.kind == "I"
        with pytest.raises(UnreachablePose):
            function(robot, [0.0, 0.0, -1.4751])
    assert np.isfinite(pteron.inverse_kinematics(robot, edge)).all()


@EVERY
@pytest.mark.parametrize("sign", [1, -1])
def test_a_singular_orientation_is_of_type_2(name, sign):
    pose = LOOSE * [1, 1, 1, sign]
    if name not in NEED_J:
        assert all(np.isfinite(a).all() for a in call(name, ROBOT, pose))
        return
    with pytest.raises(SingularPose, match=r"^pose: singular \(type II; measure") as caught:
        call(name, ROBOT, pose)
    assert (caught.value.kind, caught.value.leg, caught.value.index) == ("II", 0, ())
    assert 0.0 <= caught.value.measure < 1e-15


def test_forces_are_given_down_to_the_bound_of_the_type_2_measure():
    slope = abs(pteron.compile(ROBOT, "type_ii")(LOOSE + np.array([0, 0, 0, 1e-7]))) / 1e-7
    for away, served in ((0.5e-9, False), (2e-9, True), (1e-8, True)):
        pose = LOOSE + np.array([0, 0, 0, away])
        velocity, acceleration = np.random.default_rng(0).normal(size=(2, 4))
        if not served:
            with pytest.raises(SingularPose) as caught:
                pteron.inverse_dynamics(ROBOT, pose, velocity, acceleration)
            # The sum of pi / 2 and 5e-10 is rounded to 2e-16.
            assert caught.value.measure == pytest.approx(slope * away, rel=1e-6)
            continue
        forces = pteron.inverse_dynamics(ROBOT, pose, velocity, acceleration)
        # One force grows as 1 / measure, its share lost to rounding with it.
        there = pteron.forward_dynamics(ROBOT, pose, velocity, forces)
        np.testing.assert_allclose(there, acceleration, rtol=0, atol=1e-14 / away)


def undetermined():
    """Return a machine, and poses in which R1 and R3 of leg 3, whose links are equal, coincide."""
    legs = [longer(leg) for leg in ROBOT.legs]
    legs[2] = ROBOT.legs[2]
    assert legs[2].upper_length == legs[2].lower_length
    on_guide = np.array(legs[2].guide_point) - legs[2].platform_point
    poses = [[*on_guide, 0.0], [*(on_guide + np.array([0.1, 0, 0])), 0.0]]
    return replace(ROBOT, legs=tuple(legs)), poses


@EVERY
def test_an_undetermined_elbow_is_refused(name):
    robot, poses = undetermined()
    for pose in poses:
        if name == "inverse_kinematics":
            # The slider is determined all the same.
            assert np.isfinite(pteron.inverse_kinematics(robot, pose)).all()
            continue
        with pytest.raises(SingularPose, match=r"leg 3: its two ends coincide, so that") as caught:
            call(name, robot, pose)
        assert (caught.value.kind, caught.value.leg) == ("elbow", 3)
        assert caught.value.measure == 0.0
    with np.errstate(all="raise"):
        found = call(name, robot, [*poses, np.zeros(4)], on_failure="nan")
    for part in found:
        assert np.isnan(part[:2]).all() or name == "inverse_kinematics"
        assert np.isfinite(part[2]).all()


# Batches: a failure stays in its own row.


@EVERY
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
    # Nor may another argument's NaN, or a number beyond all measure, leave its row.
    for k, other in enumerate(others):
        other[280 + k, 1] = [np.nan, np.inf, 1e200][k]
        failing.add(280 + k)
    served = set(bad) - failing
    shape = (3, 100, 4)
    with np.errstate(all="raise"):
        found = call(
            name, ROBOT, poses.reshape(shape), *(a.reshape(shape) for a in others), on_failure="nan"
        )
        single = call(name, ROBOT, poses[3], *(a[3] for a in others), on_failure="nan")
    same = [i for i in range(300) if i not in failing | served]
    for after, before, alone in zip(found, expected, single, strict=True):
        assert after.shape == (3, 100, *before.shape[1:])
        flat = after.reshape(before.shape)
        assert np.isnan(flat[sorted(failing)]).all()
        assert np.isfinite(flat[sorted(served)]).all()
        np.testing.assert_array_equal(flat[same], before[same])
        assert alone.shape == before.shape[1:]
        assert np.isnan(alone).all()


# Arguments.


def argument_names(name):
    third = "forces" if name.startswith("forward") else "acceleration"
    return ["pose", *["velocity", third, "wrench"][: CALLS[name][1]]]


@EVERY
def test_what_is_not_finite_is_refused_with_its_index(name):
    values = [states(ROBOT, 6)[0], *arrays(name, np.zeros((6, 4)))]
    for k, argument in enumerate(argument_names(name)):
        for value, wanted in (
            (np.nan, "a finite number"),
            (-np.inf, "a finite number"),
            (1e200, "a number of sensible size"),
        ):
            spoilt = [a.copy() for a in values]
            spoilt[k][4, 2] = value
            for given, where in ((spoilt, "[4, 2]"), ([a[4] for a in spoilt], "[2]")):
                with pytest.raises(DataError) as caught:
                    call(name, ROBOT, *given)
                assert str(caught.value) == f"{argument}{where}: {value} given, {wanted} expected"


@EVERY
def test_a_wrong_shape_or_kind_is_refused_with_what_was_expected(name):
    values = [states(ROBOT, 6)[0], *arrays(name, np.zeros((6, 4)))]
    for k, argument in enumerate(argument_names(name)):
        for wrong, words in (
            (values[k][:, :3], f"{argument}: shape (6, 3) given, (..., 4) expected"),
            (1.0, f"{argument}: shape () given, (..., 4) expected"),
            ([], f"{argument}: shape (0,) given, (..., 4) expected"),
            (["1", "2", "3", "4"], f"{argument}: not an array of real numbers"),
            ([1j, 0, 0, 0], f"{argument}: not an array of real numbers"),
            ([[1, 2, 3, 4], [1]], f"{argument}: not an array of real numbers"),
            (object(), f"{argument}: not an array of real numbers"),
        ):
            with pytest.raises(DataError) as caught:
                CALLS[name][0](ROBOT, *values[:k], wrong, *values[k + 1 :])
            assert str(caught.value) == words


@EVERY
def test_a_masked_element_is_no_number(name):
    values = [states(ROBOT, 6)[0], *arrays(name, np.zeros((6, 4)))]
    for k, argument in enumerate(argument_names(name)):
        masked = np.ma.masked_array(values[k], mask=np.arange(24).reshape(6, 4) == 5)
        with pytest.raises(DataError, match=rf"^{argument}: 1 of 24 elements are masked; .*NaN"):
            CALLS[name][0](ROBOT, *values[:k], masked, *values[k + 1 :])
        whole = np.ma.masked_array(values[k], mask=False)
        found = call(name, ROBOT, *values[:k], whole, *values[k + 1 :])
        for a, b in zip(found, call(name, ROBOT, *values), strict=True):
            np.testing.assert_array_equal(a, b)
            assert not isinstance(a, np.ma.MaskedArray)


def test_masked_joints_are_refused_too():
    masked = np.ma.masked_array(np.zeros(4), mask=[1, 0, 0, 0])
    with pytest.raises(DataError, match=r"^joints: 1 of 4 elements are masked"):
        pteron.direct_kinematics(ROBOT, masked)


def test_more_axes_than_arrays_have_are_refused():
    with pytest.raises(DataError, match=r"^pose: 39 axes given, at most"):
        pteron.inverse_kinematics(ROBOT, np.zeros((1,) * 38 + (4,)))


@pytest.mark.parametrize("name", [name for name, (_, more) in CALLS.items() if more])
def test_leading_axes_that_do_not_broadcast_are_named(name):
    poses = states(ROBOT, 6)[0]
    with pytest.raises(DataError, match=r"leading axes do not broadcast: pose \(5,\), velocity"):
        CALLS[name][0](ROBOT, poses[:5], *arrays(name, poses))


@pytest.mark.parametrize("choice", ["ignore", "", None, "NaN"])
def test_an_unknown_choice_on_failure_is_refused(choice):
    pose = states(ROBOT, 1)[0][0]
    calls = [lambda n=name: call(n, ROBOT, pose, on_failure=choice) for name in CALLS]
    calls += [lambda: pteron.jacobian(ROBOT, pose, on_failure=choice)]
    calls += [lambda: pteron.direct_kinematics(ROBOT, pose, on_failure=choice)]
    for refused in calls:
        with pytest.raises(DataError) as caught:
            refused()
        assert str(caught.value) == f'on_failure: {choice!r} is neither "raise" nor "nan"'


def test_a_jacobian_of_constant_rows_is_given_out_of_reach_and_at_singularities():
    for pose in (FAR, STRETCHED, LOOSE):
        assert np.isfinite(pteron.jacobian(ROBOT, pose)).all()
    with pytest.raises(DataError, match=r"pose\[0\]: nan given"):
        pteron.jacobian(ROBOT, [np.nan, 0, 0, 0])
    lost = pteron.jacobian(ROBOT, [[np.nan, 0, 0, 0], [0, 0, 0, 0]], on_failure="nan")
    assert np.isnan(lost[0]).all()
    assert np.isfinite(lost[1]).all()


# Direct kinematics: joints without a pose raise, or are NaN.


def impossible():
    """Return joints that no pose has: legs 2 and 4, along y, are a metre apart."""
    return pteron.inverse_kinematics(ROBOT, np.zeros(4)) + np.array([0, 0.5, 0, -0.5])


def test_direct_kinematics_gives_nan_on_request():
    with np.errstate(all="raise"):
        assert np.isnan(pteron.direct_kinematics(ROBOT, impossible(), on_failure="nan")).all()
        rows = [impossible(), np.zeros(4), [np.nan, 0, 0, np.inf]]
        found = pteron.direct_kinematics(ROBOT, rows, on_failure="nan")
    assert np.isfinite(found[1]).any()
    assert np.isnan(found[[0, 2]]).all()


def test_direct_kinematics_raises_by_default():
    joints = pteron.inverse_kinematics(ROBOT, states(ROBOT, 20)[0])
    joints[17] = impossible()
    with pytest.raises(UnreachablePose, match=r"^joints\[17\]: no pose has these") as caught:
        pteron.direct_kinematics(ROBOT, joints)
    assert caught.value.index == (17,)
    with pytest.raises(UnreachablePose, match=r"^joints: no pose has these") as caught:
        pteron.direct_kinematics(ROBOT, impossible())
    assert caught.value.index == ()
    with pytest.raises(DataError, match=r"^joints\[1\]: nan given, a finite number expected"):
        pteron.direct_kinematics(ROBOT, [0, np.nan, 0, 0])
    with pytest.raises(DataError, match=r"^joints: shape \(3,\) given, \(..., 4\) expected"):
        pteron.direct_kinematics(ROBOT, np.zeros(3))

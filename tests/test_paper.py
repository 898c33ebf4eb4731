"""The paper, number by number: its equations as printed, in NumPy, against the library.

Each test takes random Quadrupterons, 4-PRRU with sliders along d as the paper has them: oblique
directions, axes and gravity, both elbows. Corrections to the printed equations are those of
docs/theory/corrections.md, and only those. `docs/equations.md` names these tests.
"""

import ast
import inspect
import json
import re
import runpy
import sys
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from mechanisms import inertia, relative_error, unit

import pteron
from pteron.kernels import count_operations
from pteron.legs.circles import edges_of_reach, links_from_triangle, perpendicular_to
from pteron.reduction import model_forms
from pteron.report.costs import PAPER_CLAIM, dense_operations

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "equations.md"

sys.path.insert(0, str(ROOT / "docs" / "extensions"))
sys.path.insert(0, str(ROOT / "benchmarks"))

from equations import cited  # noqa: E402
from paper_labels import SOURCE, labels, numbers_in  # noqa: E402

MACHINES = range(8)
EVERY = pytest.mark.parametrize("seed", MACHINES)
STATES = 6


# Random machines, and the quantities of the paper at their states.


@lru_cache
def quadrupteron(seed):
    """Return a random 4-PRRU machine whose four directions are regular, as the paper has it."""
    rng = np.random.default_rng(seed)
    k = unit(rng)
    x_axis = unit(rng, k)
    frame = np.column_stack([x_axis, np.cross(k, x_axis), k])
    while True:
        directions = [unit(rng) for _ in range(4)]
        points = rng.uniform(-0.06, 0.06, (4, 3))
        rows = [[*d, np.cross(d, k) @ (frame @ s)] for d, s in zip(directions, points, strict=True)]
        if np.linalg.cond(rows / np.array([1.0, 1.0, 1.0, 0.06])) < 10.0:
            break
    legs = []
    for d, s in zip(directions, points, strict=True):
        lu, ll = rng.uniform(0.15, 0.25, 2)
        across = rng.uniform(0.75, 0.9) * np.hypot(lu, ll) * unit(rng, d)
        leg = pteron.legs.PRRR(
            guide_point=frame @ s - across + rng.uniform(-0.1, 0.1) * d,
            direction=d,
            platform_point=s,
            upper_length=lu,
            lower_length=ll,
            slider_mass=rng.uniform(0.3, 0.8),
            upper=inertia(rng, lu),
            lower=inertia(rng, ll),
            elbow=int(rng.choice([1, -1])),
        )
        legs.append(leg)
    platform = pteron.platforms.Platform("3T1R", inertia(rng, 0.08), k, x_axis)
    return pteron.Manipulator(f"paper {seed}", platform, tuple(legs), 9.81 * unit(rng))


def states_of(seed):
    """Return poses near home with velocities and accelerations, one a row."""
    rng = np.random.default_rng(1000 + seed)
    pose = rng.uniform(-1.0, 1.0, (STATES, 4)) * [0.02, 0.02, 0.02, 0.15]
    return pose, rng.normal(size=(STATES, 4)), 10.0 * rng.normal(size=(STATES, 4))


def printed(robot, x, dx, ddx):
    """Return what the paper's equations give at one state, by the names that it uses."""
    k = np.array(robot.platform.axis)
    x_axis = np.array(robot.platform.x_axis)
    frame = np.column_stack([x_axis, np.cross(k, x_axis), k])
    c, s = np.cos(x[3]), np.sin(x[3])
    rotation = frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    legs = [printed_leg(leg, k, rotation, x, dx, ddx) for leg in robot.legs]
    J = np.array([leg.row for leg in legs])
    return SimpleNamespace(k=k, rotation=rotation, legs=legs, J=J)


def printed_leg(leg, k, rotation, x, dx, ddx):
    """Return the paper's quantities of one leg at one state."""
    d, r, lu, ll = np.array(leg.direction), np.array(leg.guide_point), *lengths(leg)
    s = rotation @ leg.platform_point
    p = x[:3]
    rho = (p + s - r) @ d  # Eq. (4)
    u = (np.eye(3) - np.outer(d, d)) @ (p + s - r)  # Eq. (5)
    l_u, l_l = lemma(d, u, lu, ll, leg.elbow)  # Eqs. (6) and (7)
    row = np.array([*d, np.cross(d, k) @ s])  # Eq. (10)
    spin = np.cross(l_u, l_l) @ d
    J_u, J_l = np.zeros((6, 4)), np.zeros((6, 4))
    J_u[:3, :3], J_u[:3, 3] = np.outer(d, d), d * (d @ np.cross(k, s))  # Eq. (11)
    J_u[3:, :3], J_u[3:, 3] = np.outer(d, l_l) / spin, d * (s @ np.cross(l_l, k)) / spin
    J_l[:3, :3], J_l[:3, 3] = np.eye(3), np.cross(k, s)  # Eq. (12)
    J_l[3:, :3], J_l[3:, 3] = np.outer(d, l_u) / -spin, d * (s @ np.cross(l_u, k)) / -spin
    # Accelerations, which the paper does not print: c'' and the second derivative of Eq. (3).
    ddc = ddx[:3] + ddx[3] * np.cross(k, s) + dx[3] ** 2 * np.cross(k, np.cross(k, s))
    upper, lower = d @ (J_u @ dx)[3:], d @ (J_l @ dx)[3:]
    v = (np.eye(3) - np.outer(d, d)) @ ddc + upper**2 * l_u + lower**2 * l_l
    return SimpleNamespace(
        d=d,
        s=s,
        rho=rho,
        u=u,
        l_u=l_u,
        l_l=l_l,
        row=row,
        r=r,
        J_u=J_u,
        J_l=J_l,
        ddc=ddc,
        ddrho=d @ ddc,
        upper=upper,
        lower=lower,
        ddupper=l_l @ v / spin,
        ddlower=-l_u @ v / spin,
    )


def lengths(leg):
    """Return l_u and l_l."""
    return leg.upper_length, leg.lower_length


def lemma(d, u, lu, ll, sign):
    """Return l_u and l_l of Lemma 1, Eqs. (1) and (2), with the corrected sign of the second."""
    n = np.linalg.norm(u)
    u_hat = u / n
    root = np.sqrt((n + lu + ll) * (-n + lu + ll) * (n - lu + ll) * (n + lu - ll))
    across = root * np.cross(d, u_hat)
    l_u = ((n**2 + lu**2 - ll**2) * u_hat + sign * across) / (2.0 * n)
    l_l = ((n**2 + ll**2 - lu**2) * u_hat - sign * across) / (2.0 * n)
    return l_u, l_l


def acting(body, axes, g, a, rate, acceleration):
    """Return F_b, the wrench of weight and inertia on a body at its reference point, (6,)."""
    x, y, z = axes
    h = body.first_moment[0] * x + body.first_moment[1] * y
    force = body.mass * (g - a) - acceleration * np.cross(z, h) + rate**2 * h
    moment = z @ np.cross(h, g - a) - body.inertia * acceleration
    return np.array([*force, *(moment * z)])


def link_axes(link, d):
    """Return x along a link, y and z = d."""
    x = link / np.linalg.norm(link)
    return x, np.cross(d, x), d


def body_wrenches(robot, at, dx, ddx):
    """Return F_u and F_l of every leg, each (6,), and F_e (4,)."""
    g = np.array(robot.gravity)
    upper, lower = [], []
    for leg, q in zip(robot.legs, at.legs, strict=True):
        slides = q.ddrho * q.d
        upper.append(acting(leg.upper, link_axes(q.l_u, q.d), g, slides, q.upper, q.ddupper))
        lower.append(acting(leg.lower, link_axes(q.l_l, q.d), g, q.ddc, q.lower, q.ddlower))
    x, y = at.rotation[:, 0], at.rotation[:, 1]
    platform = acting(robot.platform.inertia, (x, y, at.k), g, ddx[:3], dx[3], ddx[3])
    return upper, lower, np.array([*platform[:3], platform[3:] @ at.k])


def slider_forces(robot, at):
    """Return F_p of Eq. (14), (4,)."""
    g = np.array(robot.gravity)
    pairs = zip(robot.legs, at.legs, strict=True)
    return np.array([leg.slider_mass * (q.d @ g - q.ddrho) for leg, q in pairs])


def at_states(seed):
    """Yield each state (x, x', x'') of a machine with the paper's quantities there."""
    robot = quadrupteron(seed)
    for state in zip(*states_of(seed), strict=True):
        yield state, printed(robot, *state)


def column(at, name):
    """Return a quantity of every leg."""
    return np.array([getattr(leg, name) for leg in at.legs])


# Section 2: position.


@EVERY
def test_lemma_1_gives_two_links_of_their_lengths_that_close_and_stay_in_the_plane(seed):
    """Eqs. (1) and (2), both signs: what the paper says may be verified by substitution."""
    for leg in quadrupteron(seed).legs:
        rng = np.random.default_rng(seed)
        d, (lu, ll) = np.array(leg.direction), lengths(leg)
        u = rng.uniform(abs(lu - ll), lu + ll) * unit(rng, d)
        for sign in (1, -1):
            l_u, l_l = lemma(d, u, lu, ll, sign)
            np.testing.assert_allclose(l_u + l_l, u, atol=1e-15)
            sizes = np.linalg.norm([l_u, l_l], axis=1)
            np.testing.assert_allclose(sizes, [lu, ll], atol=1e-14)
            np.testing.assert_allclose([l_u @ d, l_l @ d], 0.0, atol=1e-15)
            assert np.sign(np.cross(u, l_u) @ d) == sign
            # The library's, in the plane's axes.
            a = np.array(perpendicular_to(leg.direction))
            plane = np.array([a, np.cross(d, a)])
            flat = links_from_triangle(lu, ll, sign, ca.DM(plane @ u))[:2]
            found = [plane.T @ vector.full().ravel() for vector in flat]
            np.testing.assert_allclose(found, [l_u, l_l], atol=2e-15)


def test_with_diameters_in_place_of_radii_the_circles_meet_elsewhere():
    """Remark 1 says diameters; the links' lengths are radii."""
    lu, ll = 0.2, 0.25
    stretched, folded = edges_of_reach(lu, ll, (lu + ll) ** 2)
    assert stretched == 0.0
    assert folded > 0.0
    assert edges_of_reach(lu, ll, (lu - ll) ** 2)[1] == 0.0
    # Circles of these diameters would not meet at a distance of 0.3 m.
    assert min(edges_of_reach(lu, ll, 0.3**2)) > 0.0 > min(edges_of_reach(0.5 * lu, 0.5 * ll, 0.09))


@EVERY
def test_without_an_intersection_a_pose_is_out_of_reach(seed):
    """Remark 2: the radicand of the leg that is too far is negative, and no pose is returned."""
    robot, (pose, _, _) = quadrupteron(seed), states_of(seed)
    far = pose + np.array([1.0, 0.0, 0.0, 0.0])
    at = printed_reach(robot, far[0])
    assert min(at) < 0.0
    with pytest.raises(pteron.UnreachablePose) as refusal:
        pteron.inverse_kinematics(robot, far[0])
    assert at[refusal.value.leg - 1] < 0.0
    assert np.isnan(pteron.inverse_kinematics(robot, far, on_failure="nan")).any()
    assert min(printed_reach(robot, pose[0])) > 0.0


def printed_reach(robot, x):
    """Return the radicand of every leg, m^4."""
    k, x_axis = np.array(robot.platform.axis), np.array(robot.platform.x_axis)
    c, s = np.cos(x[3]), np.sin(x[3])
    turned = c * x_axis + s * np.cross(k, x_axis)
    radicands = []
    for leg in robot.legs:
        s0 = leg.platform_point
        point = x[:3] + s0[0] * turned + s0[1] * np.cross(k, turned) + s0[2] * k
        w, d = point - leg.guide_point, np.array(leg.direction)
        n, (lu, ll) = np.linalg.norm(w - (w @ d) * d), lengths(leg)
        radicands.append((n + lu + ll) * (-n + lu + ll) * (n - lu + ll) * (n + lu - ll))
    return radicands


@EVERY
def test_every_leg_closes(seed):
    """Eq. (3): r + rho d + u = p + s, with rho and the links of the library."""
    robot = quadrupteron(seed)
    for (x, _, _), at in at_states(seed):
        rho = pteron.inverse_kinematics(robot, x)
        l_u, l_l = pteron.kinematics.link_vectors(robot, x)
        starts = column(at, "r") + rho[:, None] * column(at, "d")
        np.testing.assert_allclose(starts + l_u + l_l, x[:3] + column(at, "s"), atol=1e-14)


@EVERY
def test_slider_coordinates(seed):
    """Eq. (4)."""
    for (x, _, _), at in at_states(seed):
        rho = pteron.inverse_kinematics(quadrupteron(seed), x)
        np.testing.assert_allclose(rho, column(at, "rho"), atol=1e-15)


@EVERY
def test_vectors_that_close_the_legs(seed):
    """Eq. (5)."""
    for (x, _, _), at in at_states(seed):
        l_u, l_l = pteron.kinematics.link_vectors(quadrupteron(seed), x)
        np.testing.assert_allclose(l_u + l_l, column(at, "u"), atol=1e-15)


@EVERY
def test_upper_links(seed):
    """Eq. (6)."""
    for (x, _, _), at in at_states(seed):
        l_u, _ = pteron.kinematics.link_vectors(quadrupteron(seed), x)
        np.testing.assert_allclose(l_u, column(at, "l_u"), atol=2e-15)


@EVERY
def test_lower_links(seed):
    """Eq. (7), with the other sign before the root."""
    for (x, _, _), at in at_states(seed):
        _, l_l = pteron.kinematics.link_vectors(quadrupteron(seed), x)
        np.testing.assert_allclose(l_l, column(at, "l_l"), atol=2e-15)


# Section 3: instantaneous kinematics.


def screws_of(leg, k):
    """Return the screws of Eq. (8) (5, 6), rows P, R1, R2, R3, R4 of (omega, v) about P."""
    d, s, l_u, l_l = leg.d, leg.s, leg.l_u, leg.l_l
    axes = [(d, s - l_u - l_l), (d, s - l_l), (d, s), (k, s)]
    return np.array([[0, 0, 0, *d], *([*axis, *np.cross(point, axis)] for axis, point in axes)])


@EVERY
def test_joint_screws(seed):
    """Eq. (8), with the screw of R3 that the paper uses in Eq. (9) and does not list."""
    for (x, _, _), at in at_states(seed):
        screws = pteron.kinematics.joint_screws(quadrupteron(seed), x)
        expected = np.array([screws_of(leg, at.k) for leg in at.legs])
        np.testing.assert_allclose(screws, expected, atol=1e-14)


@EVERY
def test_joint_screws_times_rates_are_the_platforms_twist(seed):
    """Eq. (9), with rates of the library and screws as printed; and that no joint is left out."""
    robot = quadrupteron(seed)
    for (x, dx, _), at in at_states(seed):
        rates = pteron.kinematics.joint_rates(robot, x, dx)
        joints = np.column_stack([rates.actuated, rates.passive])
        twist = np.array([*(dx[3] * at.k), *dx[:3]])
        for leg, own in zip(at.legs, joints, strict=True):
            screws = screws_of(leg, at.k)
            np.testing.assert_allclose(own @ screws, twist, atol=1e-11)
            # The wrench of the text, reciprocal to R1 to R4, leaves rho' alone: Eq. (10).
            reciprocal = np.array([*np.cross(leg.s, leg.d), *leg.d])
            paired = screws @ reciprocal
            np.testing.assert_allclose(paired[1:4], 0.0, atol=1e-14)


@EVERY
def test_the_jacobian(seed):
    """Eq. (10)."""
    for (x, dx, _), at in at_states(seed):
        J = pteron.jacobian(quadrupteron(seed), x)
        np.testing.assert_allclose(J, at.J, atol=1e-15)
        rates = pteron.kinematics.joint_rates(quadrupteron(seed), x, dx).actuated
        np.testing.assert_allclose(rates, at.J @ dx, atol=1e-14)


@EVERY
def test_jacobians_of_upper_links(seed):
    """Eq. (11), with d (d . (k x s)) and d (s . (l_l x k)) in its right column."""
    for (x, _, _), at in at_states(seed):
        J_u, _ = pteron.kinematics.link_jacobians(quadrupteron(seed), x)
        expected = column(at, "J_u")
        np.testing.assert_allclose(J_u, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@EVERY
def test_jacobians_of_lower_links(seed):
    """Eq. (12)."""
    for (x, _, _), at in at_states(seed):
        _, J_l = pteron.kinematics.link_jacobians(quadrupteron(seed), x)
        expected = column(at, "J_l")
        np.testing.assert_allclose(J_l, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


# Section 4: dynamics.


@EVERY
def test_actuator_forces(seed):
    """Eq. (13), body by body."""
    robot = quadrupteron(seed)
    for state, at in at_states(seed):
        upper, lower, platform = body_wrenches(robot, at, *state[1:])
        total = platform + sum(q.J_u.T @ F for q, F in zip(at.legs, upper, strict=True))
        total = total + sum(q.J_l.T @ F for q, F in zip(at.legs, lower, strict=True))
        forces = -slider_forces(robot, at) - np.linalg.solve(at.J.T, total)
        assert relative_error(pteron.inverse_dynamics(robot, *state), forces) < 1e-11


@EVERY
def test_forces_of_the_sliders(seed):
    """Eq. (14), with rho_i'' in entry i: what the sliders' masses alone ask of the actuators."""
    robot = quadrupteron(seed)
    for state, at in at_states(seed):
        D = pteron.regressor(robot, *state)
        g = np.array(robot.gravity)
        expected = np.diag(column(at, "d") @ g - column(at, "ddrho"))
        np.testing.assert_allclose(-D[:, :4], expected, atol=1e-10)
        own = D[:, :4] @ [leg.slider_mass for leg in robot.legs]
        np.testing.assert_allclose(-own, slider_forces(robot, at), atol=1e-10)


@EVERY
def test_the_dynamic_matrix(seed):
    """Eq. (15): the library's regressor, and the form that it keeps as printed."""
    robot = quadrupteron(seed)
    as_printed = pteron.compile(robot, "paper_regressor")
    for state, at in at_states(seed):
        blocks = omegas(robot, at, *state[1:])
        bracket = np.column_stack(
            [
                at.J.T @ blocks[0],
                *(q.J_u.T @ om for q, om in zip(at.legs, blocks[1], strict=True)),
                *(q.J_l.T @ om for q, om in zip(at.legs, blocks[2], strict=True)),
                blocks[3],
            ]
        )
        D = -np.linalg.solve(at.J.T, bracket)
        for found in (pteron.regressor(robot, *state), as_printed(*state)):
            np.testing.assert_allclose(found, D, rtol=0, atol=1e-11 * np.abs(D).max())


def omegas(robot, at, dx, ddx):
    """Return Omega_p (4, 4), each Omega_u and Omega_l (6, 4), and Omega_e (4, 4)."""
    g = np.array(robot.gravity)

    def omega(axes, a, rate, acceleration):
        """Return what acts on a body per unit of m, m gamma_x, m gamma_y and I, (6, 4)."""
        units = (SimpleNamespace(mass=e[0], first_moment=e[1:3], inertia=e[3]) for e in np.eye(4))
        return np.array([acting(body, axes, g, a, rate, acceleration) for body in units]).T

    sliders = np.diag(column(at, "d") @ g - column(at, "ddrho"))
    upper, lower = [], []
    for q in at.legs:
        upper.append(omega(link_axes(q.l_u, q.d), q.ddrho * q.d, q.upper, q.ddupper))
        lower.append(omega(link_axes(q.l_l, q.d), q.ddc, q.lower, q.ddlower))
    whole = omega((at.rotation[:, 0], at.rotation[:, 1], at.k), ddx[:3], dx[3], ddx[3])
    return sliders, upper, lower, np.vstack([whole[:3], at.k @ whole[3:]])


@EVERY
def test_the_order_of_the_parameters(seed):
    """Eq. (16): sliders, upper links, lower links, platform; m, m gamma_x, m gamma_y, I of each."""
    robot = quadrupteron(seed)

    def four(body):
        return [body.mass, *body.first_moment, body.inertia]

    expected = [leg.slider_mass for leg in robot.legs]
    for bodies in ([leg.upper for leg in robot.legs], [leg.lower for leg in robot.legs]):
        expected += [value for body in bodies for value in four(body)]
    expected += four(robot.platform.inertia)
    assert len(expected) == 40
    np.testing.assert_array_equal(pteron.parameters(robot), expected)


@EVERY
def test_frames_of_the_bodies(seed):
    """Fig. 3: a mass at the end of a link is where its frame says; the lower link's is on R3."""
    robot = quadrupteron(seed)
    names = list(pteron.parameter_names(robot))
    body_by_body = pteron.compile(robot, "paper_regressor")
    for state, _ in at_states(seed):
        D = body_by_body(*state)
        np.testing.assert_allclose(
            pteron.regressor(robot, *state), D, rtol=0, atol=1e-11 * np.abs(D).max()
        )

        def forces(D=D, **values):
            return sum(D[:, names.index(name)] * value for name, value in values.items())

        for i, leg in enumerate(robot.legs, start=1):
            lu, ll = lengths(leg)
            elbow_of_upper = {f"m_u{i}": 1.0, f"mgx_u{i}": lu, f"I_u{i}": lu**2}
            elbow_of_lower = {f"m_l{i}": 1.0, f"mgx_l{i}": -ll, f"I_l{i}": ll**2}
            x, y, _ = leg.platform_point
            end = {"m_e": 1.0, "mgx_e": x, "mgy_e": y, "I_e": x * x + y * y}
            on_slider = {f"m_p{i}": 1.0}
            scale = np.abs(D).max()
            for one, other in (
                (elbow_of_upper, elbow_of_lower),
                ({f"m_l{i}": 1.0}, end),
                (on_slider, {f"m_u{i}": 1.0}),
            ):
                np.testing.assert_allclose(
                    forces(**one), forces(**other), rtol=0, atol=1e-12 * scale
                )


def test_where_a_leg_is_along_k_its_last_joint_is_one():
    """Section 2: leg 1 of the paper's machine ends in an R joint; the others end in a U joint."""
    robot = pteron.load("quadrupteron")
    alone = [np.allclose(np.cross(leg.direction, robot.platform.axis), 0.0) for leg in robot.legs]
    assert alone == [True, False, False, False]
    state = [0.01, -0.02, 0.03, 0.2], [0.1, 0.2, -0.1, 1.5]
    rates = pteron.kinematics.joint_rates(robot, *state).passive
    assert rates[0, -1] == 0.0
    np.testing.assert_allclose(rates[1:, -1], 1.5, atol=1e-15)


# The claims.


def test_operations_of_three_ways_to_the_links():
    """Contribution 1: the page's counts are those of the benchmark's functions."""
    ways = runpy.run_path(str(ROOT / "benchmarks" / "inverse_position.py"))
    robot = pteron.load("quadrupteron")
    functions = [ways["whole"](robot, ways[n]) for n in ("as_printed", "in_plane", "by_half_angle")]
    functions.append(ways["newton_function"](robot))
    counts = [count_operations(function) for function in functions]
    section = PAGE.read_text(encoding="utf-8").partition("### Contribution 1")[2]
    assert re.findall(r"(?m)^\| .* \| (\d+) \|$", section)[:4] == [str(count) for count in counts]
    pose = [0.01, -0.02, 0.03, 0.2]
    for function in functions[:3]:
        _, l_u, l_l = function(pose)
        links = pteron.kinematics.link_vectors(robot, pose)
        np.testing.assert_allclose([l_u.full().T, l_l.full().T], links, atol=1e-13)


@lru_cache
def counts_of_the_claim():
    """Return operations of the readings: dense and graphs, Eq. (13), Eq. (15), 26 columns."""
    base = pteron.base_parameters("quadrupteron")
    graphs = {key: kernel.operations for key, kernel in model_forms(base).items()}
    benchmark = runpy.run_path(str(ROOT / "benchmarks" / "paper_claim.py"))
    sparse = [kernel.operations for kernel in benchmark["sparse_kernels"](base).values()]
    dense = benchmark["dense_virtual_work_operations"](base)
    every = (dense_operations(base, columns) for columns in (range(40), base.kept))
    bodies = graphs["virtual work", "complete"]
    return {
        "full": (dense, *every),
        "sparse": tuple(sparse),
        **{
            name: (bodies, graphs[form, "complete"], graphs[form, "reduced"])
            for name, form in (("graph", "regressor"), ("graph, last", "regressor, J^-T last"))
        },
        "factored": [graphs["factored", which] for which in ("complete", "reduced", "cheapest")],
    }


def test_the_verdict_on_41_percent_follows_from_the_counts():
    counts = counts_of_the_claim()
    saved = {name: 1.0 - n[2] / n[1] for name, n in counts.items() if name != "factored"}
    assert round(100 * (1 - 1 / 1.41)) == 29
    matrices = sorted(round(100 * saved[name]) for name in ("full", "sparse"))
    graphs = sorted(round(100 * saved[name]) for name in ("graph", "graph, last"))
    assert f"saves {matrices[0]} to {matrices[1]} % of the operations" in PAPER_CLAIM
    assert f"saves {graphs[0]} to {graphs[1]} % of the operations" in PAPER_CLAIM
    least, most = map(int, re.findall(r"(\d+) to (\d+) % of the time", PAPER_CLAIM)[0])
    faster = [round(100 * (1 / (1 - share / 100) - 1)) for share in (least, most)]
    assert f"which is {faster[0]} to {faster[1]} % faster" in PAPER_CLAIM
    # The first statement is right in size in one reading, the second in none.
    assert 0.29 < max(saved.values()) < 0.41
    assert least < 29 < most < 41
    for name, (by_bodies, _, reduced) in counts.items():
        if name != "factored":
            assert reduced > by_bodies


def test_the_table_of_readings_has_the_counts():
    text = (ROOT / "docs" / "theory" / "corrections.md").read_text(encoding="utf-8")
    counts = counts_of_the_claim()
    rows = re.findall(
        r"(?m)^\| (?:full|sparse|one graph).* \| (\d+) \| (\d+) \| (\d+) % (\w+)", text
    )
    expected = []
    for k, names in (
        (1, ("full", "sparse", "graph", "graph, last")),
        (0, ("full", "sparse", "graph, last")),
    ):
        for name in names:
            original, reduced = counts[name][k], counts[name][2]
            change = round(100 * (reduced / original - 1))
            word = "more" if change > 0 else "fewer"
            expected.append((str(original), str(reduced), str(abs(change)), word))
    assert rows == expected
    factored = "takes {} operations with 40 parameters, {} (11 % fewer)"
    assert factored.format(*counts["factored"][:2]) in " ".join(text.split())
    assert round(100 * (1 - counts["factored"][1] / counts["factored"][0])) == 11


@pytest.mark.parametrize(
    "name",
    [
        *("docs/theory/corrections.md", "docs/evidence.md", "paper/paper.md"),
        "docs/notebooks/1-the-paper-reproduced.ipynb",
    ],
)
def test_documents_state_the_same_verdict(name):
    """The report takes it from where it stands."""
    text = (ROOT / name).read_text(encoding="utf-8")
    if name.endswith(".ipynb"):
        text = " ".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
    assert PAPER_CLAIM in " ".join(text.split())


# The page: from a number to its lines and its test.

NUMBERS = [
    *("Lemma 1", "Remark 1", "Remark 2"),
    *(f"Eq. ({number})" for number in range(1, 17)),
    *("Fig. 1", "Fig. 2", "Fig. 3", "Table 1"),
    *("Contribution 1", "Contribution 2", "Contribution 3", "Section 2", "Section 3", "Section 4"),
    *("Section 5 (a)", "Section 5 (b)", "Section 5 (c)", "Section 5 (d)", "Section 6"),
]


def rows_of_page():
    """Return the cells of each row that begins with a number of the paper, by the number."""
    rows = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if line.startswith("|") and len(cells) == 7 and numbers_in(cells[0]) == [cells[0]]:
            assert cells[0] not in rows, f"{cells[0]} has two rows"
            rows[cells[0]] = cells
    return rows


def places(cell):
    """Return the (file, function) pairs of a cell."""
    pairs = re.findall(r"`([\w/]+\.py)`(?: `([\w.]+)`)?", cell)
    return {(file, name) for file, name in pairs}


def mismatches(rows, every_label):
    """Return the numbers whose rows name other lines than those that carry them."""
    found = {number: set() for number in NUMBERS}
    for label in every_label:
        found.setdefault(label.number, set()).add((label.file, label.name))
    return [n for n, where in found.items() if n not in rows or places(rows[n][2]) != where]


def test_every_number_of_the_paper_has_a_row():
    assert sorted(rows_of_page()) == sorted(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_number_leads_to_the_lines_that_compute_it_and_to_its_test(number):
    _, says, _, call, explained, proof, _ = rows_of_page()[number]
    assert says
    assert number not in mismatches(rows_of_page(), labels())
    function = pteron
    for part in call.strip("`").split(".")[1:]:
        function = getattr(function, part)
    assert callable(function)
    assert re.match(r"\[.+\]\(.+\)$", explained)
    file, test = proof.strip("`").split("::")
    tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
    assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_a_label_that_moves_or_goes_is_seen():
    rows, every_label = rows_of_page(), labels()
    assert mismatches(rows, every_label) == []
    for k, label in enumerate(every_label):
        others = [*every_label[:k], *every_label[k + 1 :]]
        twice = [other for other in others if other[:2] + other[3:4] == label[:2] + label[3:4]]
        assert twice or mismatches(rows, others) == [label.number]
        moved = label._replace(name="elsewhere")
        assert mismatches(rows, [*others, moved]) == [label.number]


def test_docstrings_cite_equations_where_they_are_computed_or_returned():
    """A citation is no label; this keeps it from standing where another equation is meant."""
    rows, every_label = rows_of_page(), labels()
    allowed = {
        number: {label.file for label in every_label if label.number == number} for number in rows
    }
    for number, cells in rows.items():
        function = pteron
        for part in cells[3].strip("`").split(".")[1:]:
            function = getattr(function, part)
        file = Path(inspect.getsourcefile(inspect.unwrap(function)))
        allowed[number].add(file.relative_to(SOURCE).as_posix())
    # Names of forms of the model, and the Jacobian at a pose as a value.
    for number, file in (
        *(("Eq. (13)", "reduction/forms.py"), ("Eq. (15)", "reduction/forms.py")),
        *(("Eq. (15)", "report/costs.py"), ("Eq. (10)", "kinematics/jacobian_at.py")),
    ):
        allowed[number].add(file)
    cited_somewhere = 0
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        values = [node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)]
        texts = [v.value for v in values if isinstance(v, ast.Constant)]
        texts = [text for text in texts if isinstance(text, str)]
        for number in cited("\n".join(texts)):
            cited_somewhere += 1
            assert path.relative_to(SOURCE).as_posix() in allowed[f"Eq. ({number})"], (path, number)
    assert cited_somewhere > 15

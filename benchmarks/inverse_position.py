"""The paper's first contribution, "more compact" inverse position, beside two other published ways.

All three give, from a pose, the sliders' coordinates and the vectors of all links. The paper's is
the intersection of two circles, Eqs. (4) to (7). The second solves A cos t + B sin t = C for the
upper link's angle by the half-angle substitution (Merlet, Parallel Robots, 2nd ed., and textbooks
of serial arms). The third closes each leg numerically, by Newton's steps on both angles. Operations
are counted from the graphs, shared subexpressions once and simplified alike; they depend on no
computer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.kernels import count_operations
from pteron.kernels.passes import optimise_function
from pteron.legs.circles import perpendicular_to

Links = tuple[ca.SX, ca.SX, ca.SX]
"""rho, l_u (3, 1) and l_l (3, 1) of one leg."""

Array = NDArray[np.float64]

Quadrupteron = Any
"""A manipulator whose legs are all P-R-R-R."""

_STARTS = (1e-3, 1e-2, 1e-1, 0.5)
"""Errors of both angles at Newton's start, rad: a sample of 1 kHz away, up to another pose."""

_CLOSED = 1e-12
"""Closure, m, at which Newton's steps end: rounding of lengths of 0.1 to 1 m is some 1e-16."""

_MOST_STEPS = 50


def main() -> None:
    """Print the counts of the Quadrupteron, per leg and whole, with the greatest difference."""
    robot = pteron.load("quadrupteron")
    poses = pteron.random_poses(robot, 200, seed=0, type_i=0.3)
    expected = pteron.kinematics.link_vectors(robot, poses)[0]
    print(f"rho, l_u and l_l of the Quadrupteron's {len(robot.legs)} legs{'operations':>15}")
    for title, links in (
        ("two circles, Eqs. (4) to (7) as printed", as_printed),
        ("two circles, n^2 alone and l_l = u - l_u", in_plane),
        ("half-angle substitution", by_half_angle),
    ):
        function = whole(robot, links)
        values = np.array([function(x)[1].full().T for x in poses])
        error = np.abs(values - expected).max()
        print(f"{title:<50}{count_operations(function):>7}   within {error:.0e} m")
    step = newton_function(robot)
    print(f"{'numerical closure, one step of Newton':<50}{count_operations(step):>7}")
    for error in _STARTS:
        steps, lost = iterate(robot, step, poses, error)
        total = round(steps * count_operations(step))
        print(
            f"{f'  from angles off by {error:g} rad, {steps:.1f} steps':<50}{total:>7}"
            f"   {100.0 * lost:.0f} % end at another elbow or nowhere"
        )


def whole(robot: Quadrupteron, links: Callable[..., Links]) -> ca.Function:
    """Return the function of a pose that gives rho (n,), l_u (3, n) and l_l (3, n)."""
    pose = ca.SX.sym("pose", robot.freedom)
    legs = [
        links(leg, point)
        for leg, point in zip(robot.legs, platform_points(robot, pose), strict=True)
    ]
    outputs = [ca.vertcat(*(leg[0] for leg in legs))]
    outputs += [ca.horzcat(*(leg[k] for leg in legs)) for k in (1, 2)]
    return optimise_function(ca.Function("links", [pose], ca.cse(outputs)))


def platform_points(robot: Quadrupteron, pose: ca.SX) -> list[ca.SX]:
    """Return p + R(phi) s0 of every leg, with structural zeros of R and s0 left out."""
    k, x_axis = np.array(robot.platform.axis), np.array(robot.platform.x_axis)
    cosine, sine = ca.cos(pose[3]), ca.sin(pose[3])
    x, y = ca.SX(ca.DM(x_axis)), ca.SX(ca.DM(np.cross(k, x_axis)))
    points = []
    for leg in robot.legs:
        s = leg.platform_point
        across = cosine * (s[0] * x + s[1] * y) + sine * (s[0] * y - s[1] * x)
        points.append(ca.sparsify(pose[:3] + across + s[2] * ca.DM(k)))
    return points


def slider_and_vector(leg: pteron.legs.PRRR, point: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return rho, u and d, Eqs. (4) and (5)."""
    d = ca.sparsify(ca.SX(ca.DM(list(leg.direction))))
    w = point - ca.DM(list(leg.guide_point))
    rho = ca.dot(w, d)
    return rho, w - rho * d, d


def as_printed(leg: pteron.legs.PRRR, point: ca.SX) -> Links:
    """Return one leg's links by Eqs. (6) and (7) as they are printed, with unit vectors."""
    rho, u, d = slider_and_vector(leg, point)
    lu, ll = leg.upper_length, leg.lower_length
    n = ca.sqrt(ca.dot(u, u))
    u_hat = u / n
    root = leg.elbow * ca.sqrt((n + lu + ll) * (-n + lu + ll) * (n - lu + ll) * (n + lu - ll))
    across = root * ca.cross(d, u_hat)
    upper = ((n**2 + lu**2 - ll**2) * u_hat + across) / (2 * n)
    lower = ((n**2 + ll**2 - lu**2) * u_hat - across) / (2 * n)
    return rho, upper, lower


def in_plane(leg: pteron.legs.PRRR, point: ca.SX) -> Links:
    """Return the same with n^2 alone, the factors of the radicand in pairs, and l_l = u - l_u."""
    rho, u, d = slider_and_vector(leg, point)
    lu, ll = leg.upper_length, leg.lower_length
    n2 = ca.dot(u, u)
    root = ca.sqrt(((lu + ll) ** 2 - n2) * (n2 - (lu - ll) ** 2))
    upper = (0.5 + (0.5 * (lu**2 - ll**2)) / n2) * u
    upper = upper + ((0.5 * leg.elbow) * (root / n2)) * ca.cross(d, u)
    return rho, upper, u - upper


def by_half_angle(leg: pteron.legs.PRRR, point: ca.SX) -> Links:
    """Return the links from t = tan(theta_u / 2), a root of (A + C) t^2 - 2 B t + C - A = 0."""
    rho, u, _ = slider_and_vector(leg, point)
    lu, ll = leg.upper_length, leg.lower_length
    a, b = plane_axes(leg)
    ua, ub = ca.dot(u, a), ca.dot(u, b)
    A, B = 2 * lu * ua, 2 * lu * ub
    C = ua * ua + ub * ub + lu**2 - ll**2
    t = (B + leg.elbow * ca.sqrt(A * A + B * B - C * C)) / (A + C)
    denominator = 1 + t * t
    upper = lu * ((1 - t * t) / denominator * a + 2 * t / denominator * b)
    return rho, upper, u - upper


def plane_axes(leg: pteron.legs.PRRR) -> list[ca.SX]:
    """Return two unit vectors at right angles that span the leg's plane."""
    a = np.array(perpendicular_to(leg.direction))
    b = np.cross(leg.direction, a)
    return [ca.sparsify(ca.SX(ca.DM(np.round(v, 15)))) for v in (a, b)]


def newton_function(robot: Quadrupteron) -> ca.Function:
    """Return one step of all legs: pose and angles (2, n) to angles, closure (2, n), rho, links."""
    pose, angles = ca.SX.sym("pose", robot.freedom), ca.SX.sym("angles", 2, len(robot.legs))
    stepped, closures, sliders, uppers, lowers = [], [], [], [], []
    for i, (leg, point) in enumerate(zip(robot.legs, platform_points(robot, pose), strict=True)):
        rho, u, _ = slider_and_vector(leg, point)
        a, b = plane_axes(leg)
        lu, ll = leg.upper_length, leg.lower_length
        cu, su, cl, sl = (f(angles[j, i]) for j in (0, 1) for f in (ca.cos, ca.sin))
        x, y = lu * cu + ll * cl - ca.dot(u, a), lu * su + ll * sl - ca.dot(u, b)
        # [-lu su, -ll sl; lu cu, ll cl] (du, dl) = -(x, y), by Cramer's rule.
        sine = cu * sl - su * cl
        stepped.append(
            ca.vertcat(
                angles[0, i] - (cl * x + sl * y) / (lu * sine),
                angles[1, i] + (cu * x + su * y) / (ll * sine),
            )
        )
        closures.append(ca.vertcat(x, y))
        sliders.append(rho)
        uppers.append(lu * (cu * a + su * b))
        lowers.append(ll * (cl * a + sl * b))
    outputs = [ca.horzcat(*stepped), ca.horzcat(*closures), ca.vertcat(*sliders)]
    outputs += [ca.horzcat(*uppers), ca.horzcat(*lowers)]
    return optimise_function(ca.Function("newton", [pose, angles], ca.cse(outputs)))


def iterate(
    robot: Quadrupteron, step: ca.Function, poses: Array, error: float
) -> tuple[float, float]:
    """Return the mean number of steps until all legs are closed, and the share of poses lost."""
    rng = np.random.default_rng(0)
    links = pteron.kinematics.link_vectors(robot, poses)
    axes = [[ca.DM(v).full().ravel() for v in plane_axes(leg)] for leg in robot.legs]
    exact = np.array(
        [
            [np.arctan2(rows[:, i] @ b, rows[:, i] @ a) for i, (a, b) in enumerate(axes)]
            for rows in links
        ]
    )
    counts = []
    for x, solution in zip(poses, np.moveaxis(exact, -1, 0), strict=True):
        angles = solution + error * rng.choice([-1.0, 1.0], solution.shape)
        for count in range(1, _MOST_STEPS + 1):
            stepped, closure, *_ = (value.full() for value in step(x, angles))
            if np.abs(closure).max() < _CLOSED:
                if np.abs(np.sin(0.5 * (angles - solution))).max() < 1e-6:
                    counts.append(count)
                break
            angles = stepped
    return float(np.mean(counts)), 1.0 - len(counts) / len(poses)


if __name__ == "__main__":
    main()

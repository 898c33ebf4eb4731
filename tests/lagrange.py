"""An independent derivation: Lagrange's equations by differentiation of energies.

Nothing of `pteron.equations` is used: positions come from trigonometry (law of cosines, atan2)
instead of the circle lemma, velocities and everything after from automatic differentiation.
"""

import casadi as ca
import numpy as np


def inverse_dynamics(robot):
    """Return a function of pose, velocity and acceleration that gives the actuator forces."""
    m = len(robot.legs)
    x, dx, ddx = ca.SX.sym("x", m), ca.SX.sym("dx", m), ca.SX.sym("ddx", m)
    kinetic, potential, sliders = 0, 0, []
    for mass, center, angle, inertia in bodies(robot, x, sliders):
        velocity = ca.mtimes(ca.jacobian(center, x), dx)
        rate = ca.mtimes(ca.jacobian(angle, x), dx) if angle is not None else 0
        kinetic += 0.5 * mass * ca.sumsqr(velocity) + 0.5 * inertia * rate**2
        potential -= mass * ca.dot(ca.DM(robot.gravity), center)
    momentum = ca.gradient(kinetic, dx)
    generalized = (
        ca.mtimes(ca.jacobian(momentum, x), dx)
        + ca.mtimes(ca.jacobian(momentum, dx), ddx)
        - ca.gradient(kinetic, x)
        + ca.gradient(potential, x)
    )
    jacobian = ca.jacobian(ca.vertcat(*sliders), x)
    function = ca.Function("lagrange", [x, dx, ddx], [generalized, jacobian])

    def forces(pose, velocity, acceleration):
        tau, jac = function(pose, velocity, acceleration)
        return np.linalg.solve(np.array(jac).T, np.array(tau).ravel())

    return forces


def bodies(robot, x, sliders):
    """Yield mass, centre of mass, angle and moment of inertia about it; add slider coordinates."""
    frame = ca.DM(np.column_stack(robot.platform.frame))
    p = x[:3]
    phi = x[3] if robot.platform.turns else 0
    turn = ca.vertcat(
        ca.horzcat(ca.cos(phi), -ca.sin(phi), 0),
        ca.horzcat(ca.sin(phi), ca.cos(phi), 0),
        ca.DM([[0, 0, 1]]),
    )
    rotation = ca.mtimes(frame, turn)
    for leg in robot.legs:
        d, e, r = (ca.DM(v) for v in (leg.direction, leg.e, leg.guide_point))
        c = p + ca.mtimes(rotation, ca.DM(leg.platform_point))
        rho = ca.dot(d, c - r) / ca.dot(d, e)
        sliders.append(rho)
        joint1 = r + rho * e
        yield leg.slider_mass, joint1, None, 0

        a = np.cross(leg.direction, np.eye(3)[np.argmin(np.abs(leg.direction))])
        a /= np.linalg.norm(a)
        a, b = ca.DM(a), ca.DM(np.cross(leg.direction, a))
        u = c - joint1
        n = ca.norm_2(u)
        lu, ll = leg.upper_length, leg.lower_length
        opening = ca.acos((n**2 + lu**2 - ll**2) / (2 * n * lu))
        upper = ca.atan2(ca.dot(u, b), ca.dot(u, a)) + leg.elbow * opening
        elbow = joint1 + lu * (ca.cos(upper) * a + ca.sin(upper) * b)
        lower = ca.atan2(ca.dot(c - elbow, b), ca.dot(c - elbow, a))
        for origin, angle, body in ((joint1, upper, leg.upper), (c, lower, leg.lower)):
            yield planar(origin, ca.cos(angle) * a + ca.sin(angle) * b, d, angle, body)
    axis = rotation[:, 2]
    yield planar(
        p, rotation[:, 0], axis, phi if robot.platform.turns else None, robot.platform.inertia
    )


def planar(origin, x_axis, z_axis, angle, body):
    gx, gy = body.center_of_mass
    center = origin + gx * x_axis + gy * ca.cross(z_axis, x_axis)
    return body.mass, center, angle, body.inertia - body.mass * (gx**2 + gy**2)

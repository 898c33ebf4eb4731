"""Machines whose platforms tilt, drawn at random: oblique, any gravity, legs alone and mixed."""

import numpy as np

import pteron
from pteron.bodies.inertia import PlanarInertia, RodInertia, SpatialInertia
from pteron.legs import PRRS, PRS, PRUR, PSS, RPS, RPUR, RRS, RSS, SRRR, UPS
from pteron.platforms import Platform

LEGS = {"3T3R": ("UPS", "PSS", "RSS"), "3R": ("UPS", "PSS", "RSS"), "2R": ("UPS", "PSS", "RSS")}
LEGS["1T2R"] = ("RPS", "PRS", "RRS")
LEGS["3T2R"] = ("PRUR", "RPUR", "UPS", "RSS")
COUNT = {"3T3R": 6, "3T2R": 5, "3R": 3, "2R": 2, "1T2R": 3}


def unit(v):
    return tuple((np.asarray(v) / np.linalg.norm(v)).tolist())


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def body(rng, size):
    """Return the inertia of a cloud of points."""
    points = size * (0.3 * rng.normal(size=3) + rng.normal(size=(8, 3)))
    mass = 3.0 * rng.uniform(0.5, 1.5)
    share = mass / len(points)
    tensor = share * sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)
    return SpatialInertia(mass, tuple(share * points.sum(0)), tuple(tensor[np.triu_indices(3)]))


def rod(rng, length, sign=1.0):
    center, mass = sign * length * rng.uniform(0.3, 0.6), rng.uniform(0.3, 1.0)
    return RodInertia.of_body(mass, (center,), 1.3 * mass * center * center)


def planar(rng, length, sign=1.0):
    x, y = sign * length * rng.uniform(0.3, 0.6), 0.1 * length * rng.normal()
    mass = rng.uniform(0.3, 1.0)
    return PlanarInertia.of_body(mass, (x, y), 1.3 * mass * (x * x + y * y))


def leg(kind, rng, r, s0, n, c0):
    """Return a leg from r to the platform point c0 at the home pose, in the plane across n."""
    w = np.array(c0) - r
    length, elbow = np.linalg.norm(w), int(rng.choice([1, -1]))
    given = {"guide_point": tuple(r), "platform_point": tuple(s0)}
    if kind in ("UPS", "RPS"):
        bodies = (
            (rod if kind == "UPS" else planar)(rng, 0.4 * length),
            (rod if kind == "UPS" else planar)(rng, 0.4 * length, -1.0),
        )
        more = {} if kind == "UPS" else {"direction": n}
        limits = (0.5 * length, 1.6 * length)
        return (UPS if kind == "UPS" else RPS)(
            **given, upper=bodies[0], lower=bodies[1], limits=limits, **more
        )
    if kind == "PRRS":
        given |= {"upper_length": 0.6 * length, "lower_length": 0.7 * length, "elbow": elbow}
        d = np.array(unit(np.cross(w, rng.normal(size=3))))
        e = unit(d + 0.4 * rng.normal(size=3))
        bodies = {"upper": planar(rng, length), "lower": planar(rng, length, -1.0)}
        return PRRS(**given, direction=tuple(d), slider_direction=e, slider_mass=0.7, **bodies)
    if kind in ("PSS", "PRS"):
        across = np.cross(n, w) / length
        e = unit(w / length + rng.choice([0.3, -0.4]) * across)
        ll = 0.9 * length
        given |= {"slider_direction": e, "slider_mass": 0.7, "lower_length": ll, "elbow": elbow}
        if kind == "PSS":
            return PSS(**given, lower=rod(rng, ll, -1.0), rods=1)
        return PRS(**given, lower=planar(rng, ll, -1.0), direction=n)
    lu, ll = 0.55 * length, 0.75 * length
    given |= {"upper_length": lu, "lower_length": ll, "elbow": elbow}
    d = np.array(n) if kind == "RRS" else np.array(n) + 0.3 * rng.normal(size=3)
    d = np.array(unit(d))
    a = unit(np.cross(d, rng.normal(size=3)))
    given |= {"direction": tuple(d), "zero_direction": a, "upper": planar(rng, lu)}
    if kind == "RSS":
        return RSS(**given, lower=rod(rng, ll, -1.0), rods=1)
    return RRS(**given, lower=planar(rng, ll, -1.0))


def universal_leg(kind, rng, s0, c0, a, b):
    """Return a P-R-U-R or R-P-U-R leg at the point c0, its links across the axes a and b."""
    along, lengths = rng.random() < 0.3, rng.uniform(0.7, 1.0, 2)
    n, lean, swing = np.cross(a, b), rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6)
    signs = rng.choice([1, -1], 2)
    if along:
        e = rng.choice([1, -1]) * a
        first, last = (
            (np.sin(swing), signs[0] * np.cos(swing)),
            (signs[1] * np.cos(lean), np.sin(lean)),
        )
        upper = first[0] * b + first[1] * n
    else:
        e = unit(np.cross(a, rng.normal(size=3)))
        upper = signs[0] * np.cos(swing) * np.array(e) + np.sin(swing) * np.cross(a, e)
        last = np.sin(lean), signs[1] * np.cos(lean)
    link = last[0] * a + last[1] * n
    ends = {"platform_point": tuple(s0), "lower_length": lengths[1]}
    ends |= {"lower": body(rng, 0.3 * lengths[1]), "second_elbow": int(signs[1])}
    if kind == "RPUR":
        upper, link = np.array(unit(np.cross(a, rng.normal(size=3)))), np.sin(lean) * a
        link += signs[1] * np.cos(lean) * n
        r = c0 - lengths[0] * upper - lengths[1] * link
        bodies = {"upper": planar(rng, 0.4), "piston": planar(rng, 0.4, -1.0)}
        limits = (0.5 * lengths[0], 1.6 * lengths[0])
        return RPUR(guide_point=tuple(r), limits=limits, **bodies, **ends)
    r = c0 - lengths[0] * upper - lengths[1] * link + rng.uniform(-0.2, 0.2) * np.array(e)
    return PRUR(
        guide_point=tuple(r),
        slider_direction=tuple(e),
        upper_length=lengths[0],
        slider_mass=0.7,
        upper=planar(rng, lengths[0]),
        elbow=int(signs[0]),
        **ends,
    )


def spherical_leg(rng, s0, v):
    """Return a spherical R-R-R leg whose last axis is along v, and along s0 on the platform."""
    first, second = rng.uniform(0.9, 1.9, 2)
    elbow, lean = int(rng.choice([1, -1])), rng.uniform(0.7, 2.4)
    w = np.array(unit(np.cross(v, rng.normal(size=3))))
    w = np.cos(second) * v + np.sin(second) * w  # the crank's end
    side = np.array(unit(np.cross(w, v)))
    # The axis u is turned about w from the plane of w and v, so that u . (w x v) has the elbow.
    away = np.cos(lean) * np.cross(side, w) - elbow * np.sin(lean) * side
    d = np.cos(first) * w + np.sin(first) * np.array(unit(away))
    return SRRR(
        direction=unit(d),
        zero_direction=unit(np.cross(d, rng.normal(size=3))),
        platform_point=tuple(s0),
        crank_arc=first,
        link_arc=second,
        upper=planar(rng, 0.5),
        lower=body(rng, 0.2),
        elbow=elbow,
    )


def machine(motion, kinds, seed, angles="rpy"):
    """Return a random machine and a pose about which it moves."""
    rng = np.random.default_rng(seed)
    n, base = COUNT[motion], rotation(rng)
    kinds = [kinds[k % len(kinds)] for k in range(n)]
    height, more = np.array([0.0, 0.0, 1.0]), {}
    azimuths = 2 * np.pi * (np.arange(n) / n) + 0.25 * rng.normal(size=n)
    if n == 6:
        azimuths = np.pi / 3 * np.arange(6) + np.tile([0.35, -0.35], 3) + 0.05 * rng.normal(size=6)
    legs = []
    flat = np.stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths], axis=-1)
    for k, (kind, way) in enumerate(zip(kinds, flat, strict=True)):
        s0 = 0.5 * np.array(flat[k - 1 if k % 2 else (k + 1) % n] if n == 6 else way)
        s0[2] += 0.1 * rng.normal()
        r = way + 0.1 * rng.normal(size=3)
        normal = np.cross([0.0, 0.0, 1.0], way)
        if motion == "1T2R":  # the plane holds the home pose
            tilt = way + 0.1 * rng.normal(size=3) * [1, 1, 0]
            normal = np.array(unit(np.cross([0.0, 0.0, 1.0], tilt)))
            r = r - normal * (normal @ (r - height - s0))
        local = (r, height + s0)
        point = base @ s0 if motion in ("2R", "3T2R") else s0
        if kind == "SRRR":
            legs.append(spherical_leg(rng, point, base @ np.array(unit(s0))))
            continue
        if kind in ("PRUR", "RPUR"):
            apart = 0.3 * rng.normal(size=3)
            at = point + apart, base @ local[1] + apart
            legs.append(universal_leg(kind, rng, *at, base[:, 2], base[:, 0]))
            continue
        legs.append(leg(kind, rng, base @ local[0], point, unit(base @ normal), base @ local[1]))
    if motion in ("3R", "2R"):
        more["center"] = tuple(base @ height)
    if motion == "3T2R":
        axes = {"axis": tuple(base[:, 2]), "second_axis": tuple(base[:, 0])}
    elif motion == "2R":
        axes = {"axis": unit(base @ [1, 0.1, 0]), "second_axis": unit(base @ [0.2, 1, 0.1])}
    else:
        axes = {"axis": tuple(base[:, 2]), "x_axis": tuple(base[:, 0])}
    platform = Platform(motion, body(rng, 0.3), angle_order=angles, **axes, **more)
    home = {
        "3T3R": [*base @ height, 0, 0, 0],
        "3T2R": [*base @ height, 0, 0],
        "3R": [0.0] * 3,
        "2R": [0.0] * 2,
    }
    home["1T2R"] = [1.0, 0.0, 0.0]
    gravity = tuple(9.81 * np.array(unit(rng.normal(size=3))))
    robot = pteron.Manipulator(f"{motion}-{'-'.join(kinds)}", platform, tuple(legs), gravity)
    return robot, np.array(home[motion], dtype=float)


def states(robot, home, count, seed=0):
    """Return random states about a pose that the robot reaches."""
    rng = np.random.default_rng(seed)
    poses = home + 0.12 * rng.uniform(-1, 1, (8 * count, len(home)))
    good = np.isfinite(pteron.inverse_kinematics(robot, poses, on_failure="nan")).all(-1)
    poses = poses[good][:count]
    return (poses, *rng.normal(size=(2, *poses.shape)))

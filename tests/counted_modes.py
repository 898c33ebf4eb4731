"""How many real poses joints have, counted another way: a dense search in phi.

Everything here is plain NumPy from the data of the legs. For each phi all loci but the last one
meet in two points, p1 and p2; each sign change of what these miss the last one by is a pose.
"""

import numpy as np


def held_loci(robot, joints):
    """Return (w, n, h, a, b, t), with a row for each leg: w |c|^2 + n.c + h = 0.

    c = p + a f_1 + b f_2 + t, f being cosine and sine of phi, or phi and zero where the platform
    slides; in a planar machine in the plane's two coordinates.
    """
    x, y, k = (np.array(axis) for axis in robot.platform.frame)
    planar = robot.platform.motion in ("2T", "2T1R")
    seen = np.array([x, y]) if planar else np.eye(3)
    found = []
    for leg, q in zip(robot.legs, joints, strict=True):
        s, r = leg.platform_point, np.array(leg.guide_point)
        still = np.array(leg.fixed_offset) + s[2] * k
        if leg.type == "PRRR":
            d, e = np.array(leg.direction), np.array(leg.slider_direction)
            height = d @ (r + q * e)
            if planar:
                height -= d @ k * (still @ k)
            w, n, h = 0.0, seen @ d, -height
        else:
            if leg.type in ("PSS", "PRR"):
                center = r + q * np.array(leg.slider_direction)
            else:
                a, d = np.array(leg.zero_direction), np.array(leg.direction)
                center = r + leg.upper_length * (np.cos(q) * a + np.sin(q) * np.cross(d, a))
            square = leg.lower_length**2
            if planar and leg.type in ("PSS", "RSS"):
                square -= ((still - center) @ k) ** 2
            center = seen @ center
            w, n, h = 1.0, -2.0 * center, center @ center - square
        found.append(
            (w, n, h, seen @ (s[0] * x + s[1] * y), seen @ (s[0] * y - s[1] * x), seen @ still)
        )
    found.sort(key=lambda locus: -locus[0])
    return [np.array(part) for part in zip(*found, strict=True)]


def count_modes(robot, joints, samples=8000):
    """Return how many poses there are of joints (n,): right if no two are nearer than a sample."""
    loci = held_loci(robot, joints)
    slides = robot.platform.slides
    # Off the angles at which machines are drawn.
    phi = 2.0 * np.pi * (np.arange(samples + 1) + 0.37) / samples
    if slides:
        phi = 3.0 * np.tan(0.5 * (phi[:-1] - np.pi))
    misses, radicand = _meet(loci, phi, slides)
    inside = radicand > 0.0
    both = inside[:-1] & inside[1:]
    signs = np.sign(misses)
    count = int(((signs[:-1] != signs[1:]) & both[:, None]).sum())
    # Where the two points meet and vanish the last locus is missed by one value.
    ends = np.flatnonzero(inside[:-1] != inside[1:])
    within, beyond = (np.where(inside[ends] == side, phi[ends], phi[ends + 1]) for side in (1, 0))
    near = np.where(inside[ends], ends, ends + 1)
    for _ in range(60):
        middle = 0.5 * (within + beyond)
        good = _meet(loci, middle, slides)[1] > 0.0
        within, beyond = np.where(good, middle, within), np.where(good, beyond, middle)
    last = np.sign(_meet(loci, within, slides)[0].mean(axis=1))
    return count + int((signs[near] != last[:, None]).sum())


def _meet(loci, phi, slides):
    """Return what the points p1 and p2 miss the last locus by (N, 2), and the radicand (N,)."""
    w, n, h, a, b, t = loci
    f1, f2 = (phi, 0.0 * phi) if slides else (np.cos(phi), np.sin(phi))
    v = a * f1[:, None, None] + b * f2[:, None, None] + t
    m = 2.0 * w[:, None] * v + n
    g = w * (v * v).sum(axis=-1) + (n * v).sum(axis=-1) + h
    center, square = -0.5 * m[:, 0], 0.25 * (m[:, 0] ** 2).sum(axis=-1) - g[:, 0]
    lines = [(m[:, i] - w[i] * m[:, 0], w[i] * g[:, 0] - g[:, i]) for i in range(1, len(w) - 1)]
    lines = [(normal, height - (normal * center).sum(axis=-1)) for normal, height in lines]
    if len(lines) == 2:
        (n1, h1), (n2, h2) = lines
        along = np.cross(n1, n2)
        length = (along**2).sum(axis=-1)
        foot = h1[:, None] * np.cross(n2, along) + h2[:, None] * np.cross(along, n1)
    else:
        ((n1, h1),) = lines
        along = np.stack([-n1[:, 1], n1[:, 0]], axis=-1)
        length = (along**2).sum(axis=-1)
        foot = h1[:, None] * n1
    foot = foot / length[:, None]
    radicand = square - (foot**2).sum(axis=-1)
    half = np.sqrt(np.maximum(radicand, 0.0) / length)[:, None] * along
    p = np.stack([center + foot - half, center + foot + half], axis=1)
    last = w[-1] * (p * p).sum(axis=-1) + (p * m[:, None, -1]).sum(axis=-1) + g[:, None, -1]
    return last, radicand

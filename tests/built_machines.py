"""Random machines as people build them, in tenths of a millimetre; their rows by NumPy alone."""

from __future__ import annotations

import numpy as np

SORTS = ("rotary", "rams", "tripod")


def machine_text(sort: str, seed: int, digits: int = 4) -> str:
    """Return the TOML text of a random machine that stands above its base, rounded to digits.

    rotary: six cranks, 0.08 to 0.5 of their rods. rams: six rams with strokes of 10 to 60 %.
    tripod: three rams, or three cranks with rods, in upright planes.
    """
    rng = np.random.default_rng([SORTS.index(sort), seed])
    legs, motion = {"rotary": _rotary, "rams": _rams, "tripod": _tripod}[sort](rng)
    inertia = [0.01, 0.0, 0.0, 0.01, 0.0, 0.02]
    lines = [
        *(f'name = "{sort}-{seed}"', "gravity = [0.0, 0.0, -9.81]", "[platform]"),
        *(f'motion = "{motion}"', "axis = [0.0, 0.0, 1.0]", "mass = 2.0"),
        *("center_of_mass = [0.0, 0.0, 0.0]", f"inertia = {inertia}"),
    ]
    for leg in legs:
        lines.append("[[legs]]")
        for key, value in leg.items():
            unit = "direction" in key
            rounded = (
                np.round(value, 12 if unit else digits) if not isinstance(value, str) else value
            )
            text = f'"{value}"' if isinstance(value, str) else str(rounded.tolist())
            lines.append(f"{key} = {value if isinstance(value, dict) else text}")
        lines += _bodies(leg)
    return "\n".join(lines) + "\n"


def least_singular_value(robot, pose, drawn=None) -> float:
    """Return the least singular value of the Pluecker rows of six legs that end in ball joints.

    Forces are of 1 N and moments over the greatest radius of the platform points; far ends of rods
    come from an own circle and sphere. Middle and radius are those of the drawn machine.
    """
    x, y, z, roll, pitch, yaw = pose
    place, turn = np.array([x, y, z]), _rotation(roll, pitch, yaw)
    points = np.array([leg.platform_point for leg in robot.legs])
    figure = np.array([leg.platform_point for leg in (drawn or robot).legs])
    middle = figure.mean(axis=0)
    length = np.linalg.norm(figure - middle, axis=1).max()
    rows = []
    for leg, point in zip(robot.legs, points, strict=True):
        tip = place + turn @ point
        way = tip - (_elbow(leg, tip) if leg.type == "RSS" else np.array(leg.guide_point))
        way /= np.linalg.norm(way)
        rows.append([*way, *(np.cross(turn @ (point - middle), way) / length)])
    return float(np.linalg.svd(np.array(rows), compute_uv=False)[-1])


def _elbow(leg, tip):
    """Return the crank's end a rod's length from the platform point, on the elbow's side."""
    guide, axis = np.array(leg.guide_point), np.array(leg.direction)
    way = tip - guide
    flat = way - (way @ axis) * axis
    far = np.linalg.norm(flat)
    along = (way @ way + leg.upper_length**2 - leg.lower_length**2) / (2.0 * far)
    beside = leg.elbow * np.sqrt(leg.upper_length**2 - along**2)
    return guide + along * flat / far + beside * np.cross(axis, flat / far)


def _rotation(roll, pitch, yaw):
    (a, b, c), (p, q, r) = np.cos([yaw, pitch, roll]), np.sin([yaw, pitch, roll])
    about_z = np.array([[a, -p, 0.0], [p, a, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[b, 0.0, q], [0.0, 1.0, 0.0], [-q, 0.0, b]])
    return about_z @ about_y @ np.array([[1.0, 0.0, 0.0], [0.0, c, -r], [0.0, r, c]])


def _circle(radius, angles):
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)


def _pairs(rng):
    """Return base points and platform points (6, 3) in pairs, the latter between the former."""
    radius = rng.uniform(0.08, 0.6)
    pairs = np.repeat(2.0 * np.pi / 3.0 * np.arange(3), 2) + rng.uniform(0.0, 2.0)
    side = np.tile([-1.0, 1.0], 3)
    base = _circle(radius, pairs + side * np.radians(rng.uniform(8.0, 25.0)))
    top = radius * rng.uniform(0.4, 0.8)
    return base, _circle(top, pairs + side * np.radians(rng.uniform(36.0, 52.0))), side, pairs


def _rotary(rng):
    base, top, side, pairs = _pairs(rng)
    beside = np.linalg.norm(base - top, axis=1).max()
    rod = beside * rng.uniform(1.6, 2.6)
    crank = rod * np.exp(rng.uniform(np.log(0.08), np.log(0.5)))
    inwards = rng.choice([-1.0, 1.0])
    legs = []
    for a, b, s, angle in zip(base, top, side, pairs, strict=True):
        zero = inwards * s * np.array([-np.sin(angle), np.cos(angle), 0.0])
        legs.append(
            {
                "type": "RSS",
                "guide_point": a,
                "platform_point": b,
                "direction": np.cross(zero, [0.0, 0.0, 1.0]),
                "zero_direction": zero,
                "upper_length": crank,
                "lower_length": rod,
                "elbow": np.array(-1),
                "rods": np.array(1),
                "limits": np.array([-1.5, 1.5]),
            }
        )
    return legs, "3T3R"


def _rams(rng):
    base, top, _, _ = _pairs(rng)
    height = np.linalg.norm(base[0]) * rng.uniform(0.8, 2.0)
    middle = np.linalg.norm(base[0] - top[0] - [0.0, 0.0, height])
    stroke = rng.uniform(0.1, 0.6)
    shortest = middle / (1.0 + stroke / 2.0)
    limits = np.array([shortest, shortest * (1.0 + stroke)])
    legs = [
        {"type": "UPS", "guide_point": a, "platform_point": b, "limits": limits}
        for a, b in zip(base, top, strict=True)
    ]
    return legs, "3T3R"


def _tripod(rng):
    angles = 2.0 * np.pi / 3.0 * np.arange(3)
    radius = rng.uniform(0.05, 0.4)
    base, top = _circle(radius, angles), _circle(radius * rng.uniform(0.4, 1.3), angles)
    rams, stroke, size = rng.random() < 0.5, rng.uniform(0.1, 0.6), rng.uniform(0.3, 0.8)
    height = radius * rng.uniform(1.2, 2.5)
    legs = []
    for a, b, angle in zip(base, top, angles, strict=True):
        across = np.array([-np.sin(angle), np.cos(angle), 0.0])
        leg = {"type": "RPS", "guide_point": a, "platform_point": b, "direction": across}
        if rams:
            middle = np.linalg.norm(a - b - [0.0, 0.0, height])
            leg["limits"] = middle / (1.0 + stroke / 2.0) * np.array([1.0, 1.0 + stroke])
        else:
            crank = radius * size
            outward = np.array([np.cos(angle), np.sin(angle), 0.0])
            leg |= {"type": "RRS", "direction": -across, "zero_direction": outward}
            rod = np.linalg.norm(a + crank * outward - b - [0.0, 0.0, height])
            leg |= {"upper_length": crank, "lower_length": rod, "elbow": np.array(-1)}
            leg["limits"] = np.array([-1.2, 1.2])
        legs.append(leg)
    return legs, "1T2R"


def _bodies(leg):
    """Return lines on bodies of slender links, of 0.1 kg each."""
    if "upper_length" in leg:
        lengths = float(leg["upper_length"]), float(leg["lower_length"])
    else:
        lengths = (float(leg["limits"][0]),) * 2
    flat = {"UPS": (1, 1), "RSS": (2, 1), "RPS": (2, 2), "RRS": (2, 2)}[leg["type"]]
    lines = []
    for key, length, sign, size in zip(("upper", "lower"), lengths, (0.5, -0.5), flat, strict=True):
        center = [sign * length, 0.0][:size]
        inertia = 0.1 * length**2 / 3.0
        lines.append(f"{key} = {{ mass = 0.1, center_of_mass = {center}, inertia = {inertia} }}")
    return lines

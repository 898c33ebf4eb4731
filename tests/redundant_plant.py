"""Redundant machines off their drawing and what is measured of them, simulated in NumPy alone.

Every leg is a crank with a rod to a platform that does not turn. The equation is |guide point +
crank - (P + platform point)| = length of the rod. Nothing of the library's mathematics is used,
only its file of the machine as drawn.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import pteron
from pteron.calibration import Measurements, ReferencePlane, Setup
from pteron.calibration.unknowns import TOLERANCES

NOISE, READING_NOISE = 2e-5, 1e-5
"""m, of what an instrument measures, and rad."""

BOXES = {
    "3-rrr-point": ([0.24, 0.2, 0.0], [0.34, 0.3, 0.0]),
    "delta-redundant": ([-0.2, -0.2, -0.75], [0.2, 0.2, -0.5]),
}
"""Corners of the poses at which is measured, m."""


@dataclass
class Cranks:
    """A platform on n cranks and rods: numbers as built, m and rad."""

    guide: np.ndarray
    """(n, 3), as are the next three."""
    axis: np.ndarray
    zero_direction: np.ndarray
    platform: np.ndarray
    upper: np.ndarray
    """(n,), as are the next two."""
    lower: np.ndarray
    zeros: np.ndarray
    side: float = 1.0
    """Of the elbows, 1 or -1."""

    def readings(self, places):
        """Return the readings (N, n) at places (N, 3) of P."""
        to_platform = places[:, None] + self.platform - self.guide
        level = np.einsum("nli,li->nl", to_platform, self.zero_direction)
        across = np.cross(self.axis, self.zero_direction)
        raised = np.einsum("nli,li->nl", to_platform, across)
        squares = self.upper**2 + (to_platform**2).sum(axis=-1) - self.lower**2
        cosine = squares / (2.0 * self.upper * np.hypot(level, raised))
        angles = np.arctan2(raised, level) + self.side * np.arccos(cosine)
        return (angles + np.pi) % (2.0 * np.pi) - np.pi - self.zeros


def as_drawn(robot):
    """Return a machine's cranks as its file draws them."""

    def column(name):
        return np.array([getattr(leg, name) for leg in robot.legs])

    points = column("guide_point"), column("direction"), column("zero_direction")
    lengths = column("upper_length"), column("lower_length"), np.zeros(len(robot.legs))
    cranks = Cranks(*points, column("platform_point"), *lengths)
    home = np.mean(BOXES[robot.name], axis=0)
    joints = pteron.inverse_kinematics(robot, home[: robot.freedom])
    errors = [
        np.abs(replace(cranks, side=side).readings(home[None]) - joints).max()
        for side in (1.0, -1.0)
    ]
    assert min(errors) < 1e-9
    return replace(cranks, side=(1.0, -1.0)[int(np.argmin(errors))])


def off_drawing(robot, names, rng):
    """Return the cranks as built, off by ordinary tolerances, and all changes by name."""
    cranks, changes = as_drawn(robot), {}
    fields = {"guide_point": "guide", "platform_point": "platform", "upper_length": "upper"}
    fields["lower_length"] = "lower"
    turns = np.zeros((len(robot.legs), 3))
    for name in names:
        leg = int(name[name.index("[") + 1 : name.index("]")]) - 1
        key, _, axis = name.split("].")[-1].replace(" about ", ".").partition(".")
        group = "zeros, rad" if name.startswith("zeros") else "directions"
        group = {"guide_point": "points", "platform_point": "points"}.get(key, group)
        group = "lengths" if "length" in key else group
        changes[name] = change = TOLERANCES[group] * rng.standard_normal()
        if name.startswith("zeros"):
            cranks.zeros[leg] += change
        elif group == "directions":
            turns[leg, "xyz".index(axis)] += change
        elif axis:
            getattr(cranks, fields[key])[leg, "xyz".index(axis)] += change
        else:
            getattr(cranks, fields[key])[leg] += change
    turned = [Rotation.from_rotvec(turn).as_matrix() for turn in turns]
    for part in (cranks.axis, cranks.zero_direction):
        part[:] = np.einsum("nij,nj->ni", turned, part)
    return cranks, changes


def places_of(robot, count, rng, level=None):
    """Return random places (N, 3) of P."""
    places = rng.uniform(*BOXES[robot.name], size=(count, 3))
    if level is not None:
        places[:, 2] = level
    return places


def measured(robot, cranks, places, kind, rng, noise=None, reading_noise=READING_NOISE):
    """Return the measurements of one kind at places (N, 3), with noise."""
    readings = cranks.readings(places)
    readings += reading_noise * rng.standard_normal(readings.shape)
    count, setup = len(places), Setup(noise=noise or {})
    seen = places + NOISE * rng.standard_normal(places.shape)
    if kind == "poses":
        return Measurements.from_readings(
            robot, readings, poses=seen[:, : robot.freedom], setup=setup
        )
    if kind == "x alone":
        poses = np.where(np.arange(robot.freedom) == 0, seen[:, : robot.freedom], np.nan)
        return Measurements.from_readings(robot, readings, poses=poses, setup=setup)
    if kind == "heights":
        level = float(places[0, 2])
        setup = replace(setup, planes={"": ReferencePlane(offset=level)})
        return Measurements.from_readings(robot, readings, heights=seen[:, 2] - level, setup=setup)
    given = Measurements.from_readings(robot, readings, setup=setup)
    if kind == "distances":
        origins = np.roll(np.arange(count), 7)
        lengths = np.linalg.norm(places - places[origins], axis=1)
        lengths += NOISE * rng.standard_normal(count)
        given = replace(given, distances=lengths, origins=origins)
    return given

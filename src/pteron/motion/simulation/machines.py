"""`Machines`: many machines of one geometry that differ in masses, drives and payload."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.arguments import expect
from pteron.equations.drives import Drives, drive_numbers
from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator, parameter_data, parameters
from pteron.motion.payload import with_payload
from pteron.shapes import Seed

_MOST = 10_000_000
"""Most machines at once."""


@dataclass(frozen=True)
class Machines:
    """Many machines of one geometry, their numbers a row each.

    Attributes
    ----------
    robot : Manipulator
        The machine that they all are but for these numbers.
    parameters : array, shape (B, N)
        Inertial parameters, in the order of `pteron.parameter_names`, without payload.
    drives : array, shape (B, 7 n)
        Numbers of the drives, in the order of `pteron.equations.drives.drive_names`.
    payload : array, shape (B,)
        What the tools carry, kg.
    """

    robot: Manipulator
    parameters: Array
    drives: Array
    payload: Array

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.payload))
        sizes = {
            "parameters": (count, len(parameters(self.robot))),
            "drives": (count, len(drive_numbers(self.robot))),
            "payload": (count,),
        }
        for name, shape in sizes.items():
            given = as_array(getattr(self, name), name, ())
            if given.shape != shape or not np.isfinite(given).all():
                raise DataError(
                    f"{name}: shape {given.shape} given, finite numbers of shape {shape} expected"
                )
            object.__setattr__(self, name, given)
        if (self.payload < 0.0).any():
            raise DataError(f"payload: {self.payload.min():g} given, 0 kg or more expected")

    def __len__(self) -> int:
        return len(self.payload)

    @property
    def loaded(self) -> Array:
        """Inertial parameters with the payload, (B, N)."""
        robot = self.robot
        one = parameters(with_payload(robot, 1.0)) - parameters(robot)
        return self.parameters + self.payload[:, None] * one

    def rows(self, chosen: slice) -> Machines:
        """Return some of them."""
        parts = self.parameters[chosen], self.drives[chosen], self.payload[chosen]
        return Machines(self.robot, *parts)


def machines_about(
    robot: RobotLike,
    count: int,
    *,
    masses: float = 0.0,
    friction: float = 0.0,
    rotors: float = 0.0,
    payload: tuple[float, float] = (0.0, 0.0),
    seed: Seed = 0,
) -> Machines:
    """Return random machines about one: tolerances of masses, drives and payload.

    Each body is made of lighter or heavier material (one factor a body, so that it stays a real
    one), and each drive has factors of its dry friction, Stribeck's included, of its viscous
    friction and of its rotor's inertia. Factors are uniform between 1 - share and 1 + share.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    count : int
        How many.
    masses, friction, rotors : float
        Shares by which they may be off, below 1.
    payload : (least, most)
        kg, uniform between them.
    seed : int
        Machine i of a seed is the same whatever their number.

    Returns
    -------
    Machines

    Raises
    ------
    DataError
        If a number is not sensible.

    Examples
    --------
    >>> from pteron.motion import machines_about
    >>> many = machines_about("tripteron", 3, masses=0.1)
    >>> len(many), many.parameters.shape
    (3, (3, 31))
    """
    robot = as_manipulator(robot)
    expect(1 <= count <= _MOST, "count", repr(count), f"a whole number from 1 to {_MOST}")
    shares = {"masses": masses, "friction": friction, "rotors": rotors}
    for name, share in shares.items():
        expect(0.0 <= share < 1.0, name, repr(share), "a share from 0 to below 1")
    least, most = as_array(payload, "payload", (2,))
    if not 0.0 <= least <= most < np.inf:
        raise DataError(f"payload: {payload!r} given, least and most expected, 0 kg or more")
    bodies = [(data.body, data.legs) for data in parameter_data(robot)]
    place = [list(dict.fromkeys(bodies)).index(body) for body in bodies]
    names, n = Drives._fields, robot.joint_count
    sizes = {"coulomb": friction, "stribeck": friction, "viscous": friction, "inertia": rotors}
    scales = np.array([sizes.get(name, 0.0) for name in names])[:, None]
    # Coulomb's and Stribeck's friction of a joint have one factor.
    rows = [names.index("coulomb" if name == "stribeck" else name) for name in names]
    total = max(place) + 1
    drawn = np.stack(
        [
            np.random.default_rng((seed, i)).uniform(-1.0, 1.0, total + len(names) * n + 1)
            for i in range(count)
        ]
    )
    drives = drawn[:, total:-1].reshape(count, len(names), n)[:, rows]
    return Machines(
        robot,
        parameters(robot) * (1.0 + masses * drawn[:, place]),
        drive_numbers(robot) * (1.0 + scales * drives).reshape(count, -1),
        least + (most - least) * (0.5 + 0.5 * drawn[:, -1]),
    )

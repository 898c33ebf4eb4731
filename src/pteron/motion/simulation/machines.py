"""`Machines`: many machines of one kind that differ in masses, drives, payload and geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.arguments import expect
from pteron.equations.drives import Drives, drive_names, drive_numbers
from pteron.equations.machine import numbers
from pteron.equations.variations import variations, varied_numbers
from pteron.errors import DataError
from pteron.kernels import Array, as_array
from pteron.manipulator import (
    Manipulator,
    RobotLike,
    as_manipulator,
    parameter_data,
    parameter_names,
    parameters,
)
from pteron.motion.payload import with_payload
from pteron.shapes import Seed, seed_number

_MOST = 10_000_000
"""Most machines at once."""

_POSITIVE = ("m", "I", "Ixx", "Iyy", "Izz")
"""Kinds of inertial parameters that no body has below 0."""


@dataclass(frozen=True)
class Machines:
    """Many machines of one kind, their numbers a row each.

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
    geometry : array, shape (B, G), optional
        Their geometry and gravity, in the order of `pteron.equations.machine.numbers`; by default
        the robot's.
    """

    robot: Manipulator
    parameters: Array
    drives: Array
    payload: Array
    geometry: Array | None = None

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.payload))
        sizes = {
            "parameters": (count, len(parameters(self.robot))),
            "drives": (count, len(drive_numbers(self.robot))),
            "payload": (count,),
        }
        if self.geometry is not None:
            sizes["geometry"] = count, len(numbers(self.robot))
        for name, shape in sizes.items():
            array = as_array(getattr(self, name), name, ())
            if array.shape != shape:
                raise DataError(f"{name}: shape {array.shape} given, shape {shape} expected")
            object.__setattr__(self, name, array)
        for name in sizes:
            self._expect_numbers(name)

    def _expect_numbers(self, name: str) -> None:
        """Raise if an array of the machines, by name, has an impossible number; name the first."""
        array, columns = getattr(self, name), tuple[str, ...]()
        least = np.full(array.shape[-1], 0.0 if name == "payload" else -np.inf)
        if name == "parameters":
            columns = parameter_names(self.robot)
            positive = [parameter.kind in _POSITIVE for parameter in parameter_data(self.robot)]
            least[positive] = 0.0
        elif name == "drives":
            columns = drive_names(self.robot)
            least[[not column.startswith("offset_") for column in columns]] = 0.0
        wrong = ~(np.isfinite(array) & (array >= least))
        if wrong.any():
            position = tuple(np.argwhere(wrong)[0].tolist())
            which = f", {columns[position[1]]}" if columns else ""
            expected = "0 or more" if least[position[-1]] == 0.0 else "a finite number"
            raise DataError(
                f"{name}: machine {position[0]}{which}: {array[position]:g} given, {expected} "
                "expected"
            )

    def __len__(self) -> int:
        return len(self.payload)

    @property
    def parameters_with_payload(self) -> Array:
        """Inertial parameters of each machine with its payload, (B, N)."""
        robot = self.robot
        unit_payload = parameters(with_payload(robot, 1.0)) - parameters(robot)
        return self.parameters + self.payload[:, None] * unit_payload

    def rows(self, chosen: slice) -> Machines:
        """Return the machines of a slice of indices."""
        parts = self.parameters[chosen], self.drives[chosen], self.payload[chosen]
        return Machines(
            self.robot, *parts, None if self.geometry is None else self.geometry[chosen]
        )

    @property
    def numbers(self) -> dict[str, Array]:
        """The machines' parameters as arrays by name, for `pteron.kernels.loops.Loop.run`."""
        plant_numbers = {
            "plant_parameters": self.parameters_with_payload,
            "plant_drives": self.drives,
        }
        if self.geometry is not None:
            plant_numbers |= dict.fromkeys(("plant_geometry", "sensed_geometry"), self.geometry)
        return {name: np.ascontiguousarray(rows[:, None]) for name, rows in plant_numbers.items()}


def machines_about(
    robot: RobotLike,
    count: int,
    *,
    masses: float = 0.0,
    friction: float = 0.0,
    rotors: float = 0.0,
    payload: tuple[float, float] = (0.0, 0.0),
    lengths: float = 0.0,
    directions: float = 0.0,
    seed: Seed = 0,
) -> Machines:
    """Return `count` random machines about a nominal one, varied within given tolerances.

    Each body's mass, first moment and inertia have one common factor, so that it remains physically
    possible; each drive has factors of its dry friction (Stribeck's included), its viscous friction
    and its rotor's inertia. Factors are uniform between 1 - share and 1 + share.

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
    lengths, directions : float
        By how much each length and each coordinate of a point may be off, m, and each direction of
        a leg or of the platform turned about an axis, rad; uniform. Masses stay on their links.
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
    for name, most_off in (("lengths", lengths), ("directions", directions)):
        expect(0.0 <= most_off < np.inf, name, repr(most_off), "0 or more")
    least, most = as_array(payload, "payload", (2,))
    if not 0.0 <= least <= most < np.inf:
        raise DataError(f"payload: {payload!r} given, least and most expected, 0 kg or more")
    bodies = [(parameter.body, parameter.legs) for parameter in parameter_data(robot)]
    place = [list(dict.fromkeys(bodies)).index(body) for body in bodies]
    names, n = Drives._fields, robot.joint_count
    sizes = {"coulomb": friction, "stribeck": friction, "viscous": friction, "inertia": rotors}
    scales = np.array([sizes.get(name, 0.0) for name in names])[:, None]
    # Coulomb's and Stribeck's friction of a joint have one factor.
    rows = [names.index("coulomb" if name == "stribeck" else name) for name in names]
    total = max(place) + 1
    changes = variations(robot) if lengths or directions else ()
    ends = np.cumsum([total, len(names) * n, 1, len(changes)])
    seed = seed_number(seed)
    every = [np.random.default_rng((seed, i)).uniform(-1.0, 1.0, ends[-1]) for i in range(count)]
    body_factors, drive_factors, payload_factors, geometry_factors = np.split(
        np.stack(every), ends[:-1], axis=1
    )
    drives = drive_factors.reshape(count, len(names), n)[:, rows]
    sizes_off = np.array(
        [directions if change.group == "directions" else lengths for change in changes]
    )
    return Machines(
        robot,
        parameters(robot) * (1.0 + masses * body_factors[:, place]),
        drive_numbers(robot) * (1.0 + scales * drives).reshape(count, -1),
        least + (most - least) * (0.5 + 0.5 * payload_factors[:, 0]),
        varied_numbers(robot, changes, sizes_off * geometry_factors) if changes else None,
    )

"""Mass transfers: dependences between inertial parameters that follow from the structure alone.

Two bodies that both carry a point may trade mass at it without any force noticing. Each transfer is
a null vector of the regressor whose entries are polynomials in the geometry: from these follow the
base parameters in symbols.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pteron.bodies.parameters import PLATFORM, Parameter
from pteron.legs.kind import LegTransfer
from pteron.manipulator import Manipulator

Values = Mapping[str, Any]
"""Numbers or expressions by the symbols `lu1`, `ll1`, `s1x`, `s1y`, ... of each leg's geometry."""


@dataclass(frozen=True)
class MassTransfer:
    """A null vector of the regressor.

    Attributes
    ----------
    reason : str
        Why it is one, for a reader.
    evaluate : callable
        Returns the entries, by column, with numbers or expressions put for the symbols.
    """

    reason: str
    evaluate: Callable[[Values], dict[Parameter, Any]]

    @property
    def entries(self) -> dict[Parameter, Any]:
        """By column, SymPy polynomials in the symbols of each leg's geometry."""
        return self.evaluate(_Symbols())


class _Symbols(dict[str, Any]):
    """SymPy's symbols by their names."""

    def __missing__(self, name: str) -> Any:
        from sympy import Symbol  # slow to import

        return Symbol(name)


def transfers(robot: Manipulator, columns: Sequence[Parameter]) -> list[MassTransfer]:
    """Return the transfers of a machine, for columns that legs may share in groups."""
    grouped: list[MassTransfer] = []
    platform = {p.kind: p for p in columns if p.body == PLATFORM}
    for group in dict.fromkeys(p.legs for p in columns if p.legs):
        places = {(p.kind, p.body): p for p in columns if p.legs == group}
        suffix = next(iter(places.values())).suffix
        legs = [robot.legs[leg - 1] for leg in group]
        leg_transfers = [leg.transfers(robot.gravity) for leg in legs]
        for transfer in leg_transfers[0]:
            # What legs share must hold for each of them, with the same lengths.
            symbols = {s for _, names in transfer.entries.values() for s in names}
            sizes = {tuple(q.value for q in leg.quantities if q.symbol in symbols) for leg in legs}
            if len(sizes) == 1 and all(transfer in others for others in leg_transfers):
                entries = partial(_leg_entries, transfer, places, group[0])
                grouped.append(MassTransfer(transfer.reason.format(suffix), entries))
        for letter in legs[0].equations_class.rides:
            mass = places["m", letter]
            name = f"{legs[0].names[letter]}{mass.suffix}"
            entries = partial(_rider_entries, robot, mass, platform, group)
            grouped.append(MassTransfer(f"{name} and platform carry the platform point", entries))
    if robot.platform.fixed_point is not None:
        unfelt = partial(_unit_entry, platform["m"])
        grouped.append(MassTransfer("the platform turns about a fixed point", unfelt))
    if not robot.platform.angles:
        reason = "the platform does not turn"
        turning = (p for p in platform.values() if p.kind != "m")
        grouped += [MassTransfer(reason, partial(_unit_entry, p)) for p in turning]
    return grouped


def _leg_entries(
    transfer: LegTransfer, places: Mapping[tuple[str, str], Parameter], leg: int, symbols: Values
) -> dict[Parameter, Any]:
    """Return the entries of a leg's transfer; legs count from 1."""
    return {
        places[key]: math.prod((symbols[f"{name}{leg}"] for name in names), start=factor)
        for key, (factor, names) in transfer.entries.items()
    }


def _rider_entries(
    robot: Manipulator,
    mass: Parameter,
    platform: Mapping[str, Parameter],
    group: Sequence[int],
    symbols: Values,
) -> dict[Parameter, Any]:
    """Return the entries by which legs' masses on platform points join the platform's inertia."""
    shares: dict[Parameter, Any] = {mass: 1}
    axes = "xyz" if robot.platform.tilts else "xy"
    for leg in group:
        coordinates = zip("xyz", robot.legs[leg - 1].platform_point, strict=True)
        point = [symbols[f"s{leg}{a}"] if a in axes and c else 0 for a, c in coordinates]
        for kind, share in robot.platform.inertia.shares_of_point(*point).items():
            shares[platform[kind]] = shares.get(platform[kind], 0) - share
    return shares


def _unit_entry(parameter: Parameter, _: Values) -> dict[Parameter, Any]:
    """Return the entry of a parameter alone: its share is 1."""
    return {parameter: 1}

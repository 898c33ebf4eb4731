"""Mass transfers: dependences between inertial parameters that follow from the structure alone.

Two bodies that both carry a point may trade mass at it without any force noticing. Each transfer is
a null vector of the regressor whose entries are polynomials in the geometry: from these follow the
base parameters in symbols.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Integer, Mul, Symbol

from pteron.bodies.parameters import PLATFORM, Parameter
from pteron.manipulator import Manipulator


@dataclass(frozen=True)
class Transfer:
    """A null vector of the regressor.

    Attributes
    ----------
    reason : str
        Why it is one, for a reader.
    entries : dict
        By column, SymPy polynomials in symbols `lu1`, `ll1`, `s1x`, `s1y`, ... of each leg's
        geometry.
    """

    reason: str
    entries: Mapping[Parameter, Any]

    def evaluate(self, values: Mapping[str, Any]) -> dict[Parameter, Any]:
        """Return the entries with numbers, or SymPy expressions, put for the symbols."""
        put = {Symbol(name): value for name, value in values.items()}
        return {column: entry.xreplace(put) for column, entry in self.entries.items()}


def transfers(robot: Manipulator, columns: Sequence[Parameter]) -> list[Transfer]:
    """Return the transfers of a machine, for columns that legs may share in groups."""
    grouped: list[Transfer] = []
    for group in dict.fromkeys(p.legs for p in columns if p.legs):
        place = {(p.kind, p.body): p for p in columns if p.legs == group}
        suffix = next(iter(place.values())).suffix
        legs = [robot.legs[leg - 1] for leg in group]
        leg_transfers = [leg.transfers(robot.gravity) for leg in legs]
        for transfer in leg_transfers[0]:
            # What legs share must hold for each of them, with the same lengths.
            symbols = {s for _, names in transfer.entries.values() for s in names}
            sizes = {tuple(q.value for q in leg.quantities if q.symbol in symbols) for leg in legs}
            if len(sizes) == 1 and all(transfer in others for others in leg_transfers):
                entries = {
                    place[key]: Mul(factor, *(Symbol(f"{s}{group[0]}") for s in names))
                    for key, (factor, names) in transfer.entries.items()
                }
                grouped.append(Transfer(transfer.reason.format(suffix), entries))
        platform = {p.kind: p for p in columns if p.body == PLATFORM}
        for letter in legs[0].equations_class.rides:
            mass = place["m", letter]
            shares: dict[Parameter, Any] = {mass: Integer(1)}
            for leg in group:
                coordinates = zip("xyz", robot.legs[leg - 1].platform_point, strict=True)
                point = [Symbol(f"s{leg}{axis}") * int(value != 0.0) for axis, value in coordinates]
                for kind, share in robot.platform.inertia.shares_of_point(*point).items():
                    shares[platform[kind]] = shares.get(platform[kind], Integer(0)) - share
            name = f"{legs[0].names[letter]}{mass.suffix}"
            grouped.append(Transfer(f"{name} and platform carry the platform point", shares))
    if robot.platform.center is not None:
        grouped.append(
            Transfer("the platform turns about a fixed point", {platform["m"]: Integer(1)})
        )
    if not robot.platform.angles:
        reason = "the platform does not turn"
        turning = (p for p in columns if p.body == PLATFORM and p.kind != "m")
        grouped += [Transfer(reason, {p: Integer(1)}) for p in turning]
    return grouped

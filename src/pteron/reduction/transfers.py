"""Mass transfers: the relations between parameters that follow from the structure alone.

Two bodies that both carry a point may trade mass at it without any force noticing. Each transfer is
a null vector of the regressor whose entries are polynomials in the geometry: the derivation of the
base parameters in symbols.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from pteron.bodies.parameters import PLATFORM, Parameter
from pteron.manipulator import Manipulator

Value = TypeVar("Value")


@dataclass(frozen=True)
class Monomial:
    """An integer times a product of geometric symbols."""

    factor: int
    symbols: tuple[str, ...] = ()


Polynomial = tuple[Monomial, ...]

_ONE: Polynomial = (Monomial(1),)


@dataclass(frozen=True)
class Transfer:
    """A null vector of the regressor.

    Attributes
    ----------
    reason : str
        Why it is one, for a reader.
    entries : dict
        By column, in symbols `lu1`, `ll1`, `s1x`, `s1y`, ... of each leg's geometry.
    """

    reason: str
    entries: Mapping[Parameter, Polynomial]

    def evaluate(
        self,
        symbols: Mapping[str, Value],
        number: Callable[[int], Value],
        add: Callable[[Value, Value], Value],
        multiply: Callable[[Value, Value], Value],
    ) -> dict[Parameter, Value]:
        """Return the entries with values put for the symbols, in any arithmetic."""
        values = {}
        for column, polynomial in self.entries.items():
            total = number(0)
            for monomial in polynomial:
                term = number(monomial.factor)
                for symbol in monomial.symbols:
                    term = multiply(term, symbols[symbol])
                total = add(total, term)
            values[column] = total
        return values


def transfers(robot: Manipulator, columns: Sequence[Parameter]) -> list[Transfer]:
    """Return the transfers of a machine, for columns that legs may share in groups."""
    found: list[Transfer] = []
    for group in dict.fromkeys(p.legs for p in columns if p.legs):
        place = {(p.kind, p.body): p for p in columns if p.legs == group}
        suffix = next(iter(place.values())).suffix
        legs = [robot.legs[leg - 1] for leg in group]
        own = [leg.transfers(robot.gravity) for leg in legs]
        for transfer in own[0]:
            # What legs share must hold for each of them, with the same lengths.
            symbols = {s for _, names in transfer.entries.values() for s in names}
            sizes = {tuple(q.value for q in leg.quantities if q.symbol in symbols) for leg in legs}
            if len(sizes) == 1 and all(transfer in others for others in own):
                entries = {
                    place[key]: (Monomial(factor, tuple(f"{s}{group[0]}" for s in names)),)
                    for key, (factor, names) in transfer.entries.items()
                }
                found.append(Transfer(transfer.reason.format(suffix), entries))
        platform = {p.kind: p for p in columns if p.body == PLATFORM}
        for letter in legs[0].equations_class.rides:
            found.append(_platform_point(robot, group, place["m", letter], platform))
    if not robot.platform.turns:
        reason = "the platform does not turn"
        turning = (p for p in columns if p.body == PLATFORM and p.kind != "m")
        found += [Transfer(reason, {p: _ONE}) for p in turning]
    return found


def _platform_point(
    robot: Manipulator,
    group: tuple[int, ...],
    mass: Parameter,
    platform: Mapping[str, Parameter],
) -> Transfer:
    name = robot.legs[group[0] - 1].names[mass.body]
    x: list[Monomial] = []
    y: list[Monomial] = []
    square: list[Monomial] = []
    for leg in group:
        for axis, moment, value in zip(
            "xy", (x, y), robot.legs[leg - 1].platform_point, strict=False
        ):
            if value != 0.0:
                symbol = f"s{leg}{axis}"
                moment.append(Monomial(-1, (symbol,)))
                square.append(Monomial(-1, (symbol, symbol)))
    return Transfer(
        f"{name}{mass.suffix} and platform carry the platform point",
        {
            mass: _ONE,
            platform["m"]: (Monomial(-len(group)),),
            platform["mgx"]: tuple(x),
            platform["mgy"]: tuple(y),
            platform["I"]: tuple(square),
        },
    )

"""Mass transfers: the relations between parameters that follow from the structure alone.

Two bodies that both carry a point may trade mass at it without any force noticing. Each transfer is
a null vector of the regressor whose entries are polynomials in the geometry: the derivation of the
base parameters in symbols.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from pteron.manipulator import Manipulator
from pteron.bodies.vectors import norm, parallel, scaled
from pteron.reduction.sharing import suffix

__all__ = ["Monomial", "Polynomial", "Transfer", "transfers"]

Value = TypeVar("Value")


@dataclass(frozen=True)
class Monomial:
    """An integer times a product of geometric symbols."""

    factor: int
    symbols: tuple[str, ...] = ()


Polynomial = tuple[Monomial, ...]

_ONE: Polynomial = (Monomial(1),)
_LESS: Polynomial = (Monomial(-1),)


@dataclass(frozen=True)
class Transfer:
    """A null vector of the regressor.

    Attributes
    ----------
    reason : str
        Why it is one, for a reader.
    entries : dict
        By column name, in symbols `lu1`, `ll1`, `s1x`, `s1y`, ... of each leg's geometry.
    """

    reason: str
    entries: Mapping[str, Polynomial]

    def evaluate(
        self,
        symbols: Mapping[str, Value],
        number: Callable[[int], Value],
        add: Callable[[Value, Value], Value],
        multiply: Callable[[Value, Value], Value],
    ) -> dict[str, Value]:
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


def transfers(robot: Manipulator, groups: list[tuple[int, ...]]) -> list[Transfer]:
    """Return the transfers of a machine whose legs share parameters in groups."""
    found: list[Transfer] = []
    for group in groups:
        end = suffix(group, len(robot.legs))
        found.append(
            Transfer(
                f"slider and upper link{end} move as one along the guide",
                {f"m_u{end}": _ONE, f"m_p{end}": _LESS},
            )
        )
        legs = [robot.legs[leg - 1] for leg in group]
        first = group[0]
        if len({(leg.upper_length, leg.lower_length) for leg in legs}) == 1:
            lu, ll = f"lu{first}", f"ll{first}"
            found.append(
                Transfer(
                    f"both links{end} carry the elbow R2",
                    {
                        f"m_u{end}": _ONE,
                        f"mgx_u{end}": (Monomial(1, (lu,)),),
                        f"I_u{end}": (Monomial(1, (lu, lu)),),
                        f"m_l{end}": _LESS,
                        f"mgx_l{end}": (Monomial(1, (ll,)),),
                        f"I_l{end}": (Monomial(-1, (ll, ll)),),
                    },
                )
            )
        found.append(_platform_point(robot, group, end))
        if all(_gravity_is_still(robot, leg - 1) for leg in group):
            found += [
                Transfer(
                    f"no gravity and no slider acceleration acts across the upper link{end}",
                    {f"{kind}_u{end}": _ONE},
                )
                for kind in ("mgx", "mgy")
            ]
    if not robot.platform.turns:
        found += [
            Transfer("the platform does not turn", {f"{kind}_e": _ONE})
            for kind in ("mgx", "mgy", "I")
        ]
    return found


def _platform_point(robot: Manipulator, group: tuple[int, ...], end: str) -> Transfer:
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
        f"lower link{end} and platform carry the platform point R3",
        {
            f"m_l{end}": _ONE,
            "m_e": (Monomial(-len(group)),),
            "mgx_e": tuple(x),
            "mgy_e": tuple(y),
            "I_e": tuple(square),
        },
    )


def _gravity_is_still(robot: Manipulator, i: int) -> bool:
    """Say whether neither gravity nor the slider's acceleration has a part across leg i's d."""
    leg = robot.legs[i]
    size = norm(robot.gravity)
    still = size == 0.0 or parallel(leg.direction, scaled(robot.gravity, 1.0 / size))
    return still and parallel(leg.direction, leg.e)

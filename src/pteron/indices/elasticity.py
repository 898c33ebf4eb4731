"""Elasticity of a machine, for `stiffness`: actuators as springs, links as beams."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pteron.arguments import checked_arguments
from pteron.bodies.vectors import number
from pteron.errors import ModelError
from pteron.manipulator import Manipulator
from pteron.renamed import former_attribute


def _positive_number(name: str, size: Any) -> float:
    """Return a positive number; infinity, which stands for rigid, is allowed."""
    checked = math.inf if size == math.inf else number(size, name)
    if not checked > 0.0:
        raise ModelError(f"{name}: {checked:g} given, a number above 0 expected")
    return checked


@dataclass(frozen=True)
class Material:
    """An elastic material.

    Parameters
    ----------
    young : float
        E, Pa.
    shear : float
        G, Pa.
    strength : float
        Stress at which it yields, or breaks under pressure, Pa.
    density : float
        kg/m^3.
    """

    young: float
    shear: float
    strength: float = math.inf
    density: float = math.inf

    def __post_init__(self) -> None:
        for name in ("young", "shear", "strength", "density"):
            object.__setattr__(self, name, _positive_number(name, getattr(self, name)))


STEEL = Material(210e9, 81e9, 235e6, 7850.0)
"""Steel of precision tubes, E235 of EN 10305: 210 and 81 GPa, yields at 235 MPa."""

ALUMINIUM = Material(70e9, 26e9, 160e6, 2700.0)
"""Aluminium 6060-T66 of EN 755-2: 70 and 26 GPa, yields at 160 MPa."""

CARBON = Material(120e9, 5e9, 400e6, 1600.0)
"""Carbon fibre in resin, mostly along the tube: breaks under 400 MPa of pressure."""

MATERIALS = {"steel": STEEL, "aluminium": ALUMINIUM, "carbon": CARBON}
"""Materials of bar stock by name."""


@dataclass(frozen=True)
class Section:
    """The cross-section of a link, as stiffnesses; infinite where it is rigid.

    Of parallel rods it is the sum of both.

    Parameters
    ----------
    axial : float
        E A, N.
    bending : float
        E I in the leg's plane, about its revolute axes, N m^2.
    sideways : float
        E I out of the leg's plane, N m^2.
    torsion : float
        G J, N m^2.
    """

    axial: float
    bending: float = math.inf
    sideways: float = math.inf
    torsion: float = math.inf

    def __post_init__(self) -> None:
        for name in ("axial", "bending", "sideways", "torsion"):
            object.__setattr__(self, name, _positive_number(name, getattr(self, name)))

    @classmethod
    def tube(cls, diameter: float, wall: float, material: Material) -> Section:
        """Return the cross-section of a round tube of outer diameter and wall thickness, m.

        A rod is a tube whose wall is half its diameter.
        """
        outer, inner = _hollow("diameter", diameter, wall)
        area, second = (math.pi / d * (outer**p - inner**p) for d, p in ((4, 2), (64, 4)))
        e_i = material.young * second
        return cls(material.young * area, e_i, e_i, 2 * material.shear * second)

    @classmethod
    def square_tube(cls, side: float, wall: float, material: Material) -> Section:
        """Return the cross-section of a square tube of outer side and wall thickness, m.

        The torsional stiffness is Bredt's, J = t (a - t)^3, for walls that are thin compared to the
        side.
        """
        outer, inner = _hollow("side", side, wall)
        e_i = material.young * (outer**4 - inner**4) / 12
        torsion = material.shear * wall * (outer - wall) ** 3
        return cls(material.young * (outer**2 - inner**2), e_i, e_i, torsion)


def _hollow(name: str, outer: float, wall: float) -> tuple[float, float]:
    """Return the outer and inner size of a tube, m; raise if the wall is too thick."""
    outer, wall = _positive_number(name, outer), _positive_number("wall", wall)
    if 2 * wall > outer:
        raise ModelError(f"wall: {wall:g} m given, at most half of the {name}, {outer / 2:g} m")
    return outer, outer - 2 * wall


Springs = tuple[tuple[float, ...], tuple[tuple[Section | None, Section | None], ...]]
"""The actuators' stiffness, and the sections of the upper and the lower link, of every leg."""


@checked_arguments
@dataclass(frozen=True)
class Elasticity:
    """Stiffnesses of a machine's actuators and links.

    Parameters
    ----------
    actuators : float or sequence of float
        Stiffness of each actuator at its joint, held by its controller, N/m or N m/rad: one for
        all, or one a leg; infinite where it is rigid.
    upper, lower : Section or sequence of Section or None
        Sections of the upper links or cranks, and of the lower links or rods: one for all, or one a
        leg; None where they are rigid.
    rod_distance : float, optional
        Between the two rods of a pair, m; without it their couple meets no elasticity.
    """

    actuators: float | tuple[float, ...] = math.inf
    upper: Section | tuple[Section | None, ...] | None = None
    lower: Section | tuple[Section | None, ...] | None = None
    rod_distance: float | None = None

    def __post_init__(self) -> None:
        actuators = self.actuators
        several = (actuators,) if isinstance(actuators, int | float) else tuple(actuators)
        checked = tuple(_positive_number("actuators", stiffness) for stiffness in several)
        object.__setattr__(self, "actuators", checked if len(checked) > 1 else checked[0])
        for name in ("upper", "lower"):
            sections = getattr(self, name)
            if sections is not None and not isinstance(sections, Section):
                object.__setattr__(self, name, tuple(sections))
        if self.rod_distance is not None:
            object.__setattr__(
                self, "rod_distance", _positive_number("rod_distance", self.rod_distance)
            )

    def leg_springs(self, robot: Manipulator) -> Springs:
        """Return each leg's actuator stiffness and (upper, lower) link cross-sections."""
        actuators, upper, lower = (
            self._repeat_for_legs(robot, name) for name in ("actuators", "upper", "lower")
        )
        return actuators, tuple(zip(upper, lower, strict=True))

    of_legs = former_attribute("of_legs", "leg_springs")

    def _repeat_for_legs(self, robot: Manipulator, name: str) -> tuple[Any, ...]:
        """Return the setting `name` for each leg.

        A tuple must have one value for each leg.
        """
        setting = getattr(self, name)
        if not isinstance(setting, tuple):
            return (setting,) * robot.joint_count
        if len(setting) != robot.joint_count:
            raise ModelError(
                f"{name}: {len(setting)} given, but {robot.name} has {robot.joint_count} legs; "
                "give one for all, or one a leg",
                subject=robot.name,
            )
        return setting

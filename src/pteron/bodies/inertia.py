"""The inertia of a body about its reference point: slider, rod, body in a plane or in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pteron.bodies.vectors import number, numbers, positive
from pteron.errors import ModelError
from pteron.tolerances import EXACT


@runtime_checkable
class Inertia(Protocol):
    """The inertia of a body: the kinds of its parameters, and their values."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of the body's inertial parameters, in order, such as "m", "mgx", "I"."""

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the body's inertial parameters, in the order of `kinds`.

        The units are kg, kg m and kg m^2.
        """

    @classmethod
    def of_values(cls, values: Sequence[float]) -> Self:
        """Build the inertia from its parameters' values, in the order of `kinds`.

        Raises
        ------
        ModelError
            If no real body has them.
        """


def with_center(inertia: Inertia) -> dict[str, float]:
    """Return a body's values by kind, with its centre of mass (m) in place of first moments."""
    by_kind = dict(zip(inertia.kinds, inertia.values, strict=True))
    return by_kind | {k: by_kind[k] / by_kind["m"] for k in ("mgx", "mgy", "mgz") if k in by_kind}


@dataclass(frozen=True)
class PointMass:
    """The inertia of a slider, which does not turn: its mass in kg."""

    mass: float

    kinds: ClassVar = ("m",)

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive(self.mass, "mass", "kg"))

    @classmethod
    def of_values(cls, values: Sequence[float]) -> PointMass:
        """Build the point mass from its mass, kg, the only value."""
        return cls(*values)

    @property
    def values(self) -> tuple[float, ...]:
        """The mass, kg, as the only value."""
        return (self.mass,)


@dataclass(frozen=True)
class _TurningInertia:
    """The inertia of a body that turns; its first moment has as many axes as its kinds name."""

    mass: float
    first_moment: tuple[float, ...]
    inertia: float

    kinds: ClassVar[tuple[str, ...]]

    def __post_init__(self) -> None:
        mass = positive(self.mass, "mass", "kg")
        moment = numbers(self.first_moment, "first_moment", len(self.kinds) - 2)
        inertia = number(self.inertia, "inertia")
        least = sum(h * h for h in moment) / mass
        if inertia < least * (1.0 - EXACT) or inertia <= 0.0:
            mend = f"; about the centre of mass? Then write {inertia + least:g}"
            raise ModelError(
                f"inertia: {inertia:g} kg m^2 belongs to no real body; with this mass and centre "
                f"of mass, and about the reference point, it must be above {least:g} kg m^2"
                f"{mend if inertia > 0.0 else ''}"
            )
        for key, quantity in (("mass", mass), ("first_moment", moment), ("inertia", inertia)):
            object.__setattr__(self, key, quantity)

    @classmethod
    def of_body(cls, mass: float, center_of_mass: Sequence[float], inertia: float) -> Self:
        """Build the inertia from mass, kg, centre of mass, m, and moment of inertia, kg m^2."""
        mass = positive(mass, "mass", "kg")
        center = numbers(center_of_mass, "center_of_mass", len(cls.kinds) - 2)
        return cls(mass, tuple(mass * x for x in center), inertia)

    @classmethod
    def of_values(cls, values: Sequence[float]) -> Self:
        """Build the inertia from m, m gamma_x, ... and I, in the order of `kinds`."""
        mass, *moment, inertia = values
        return cls(mass, tuple(moment), inertia)

    @property
    def center_of_mass(self) -> tuple[float, ...]:
        """Position of the centre of mass in the body's frame, m."""
        return tuple(h / self.mass for h in self.first_moment)

    @property
    def values(self) -> tuple[float, ...]:
        """The values m, m gamma_x, ... and I, in the order of `kinds`."""
        return (self.mass, *self.first_moment, self.inertia)  # Eq. (16), p_u, p_l or p_e


@dataclass(frozen=True)
class RodInertia(_TurningInertia):
    """The inertia of a rod between two ball joints, about its **platform end**.

    x points from the tip of the actuated body to the platform point, so that a usual rod has a
    negative first moment. A rod's spin about its own axis has no inertia. Parallel rods that move
    alike are one rod with the sum of their inertias.

    Parameters
    ----------
    mass : float
        Mass m, kg.
    first_moment : tuple of float
        (m gamma_x,), kg m: mass times the position of the centre of mass along the rod.
    inertia : float
        Moment of inertia I across the rod **through the platform end**, kg m^2.

    Raises
    ------
    ModelError
        If no real rod has this inertia: the mass must be positive and I m >= (m gamma_x)^2.
    """

    kinds: ClassVar = ("m", "mgx", "I")


@dataclass(frozen=True)
class PlanarInertia(_TurningInertia):
    """The inertia of a link or of the platform about its reference point, in its own frame.

    The reference point of an upper link or a crank is on R1, with x along the link; that of a
    **lower link is on R3, the platform's end**, with x pointing from R2 to R3, so that a usual
    lower link has a negative first moment along x; that of the platform is P.

    Parameters
    ----------
    mass : float
        Mass m, kg.
    first_moment : tuple of float
        (m gamma_x, m gamma_y), kg m: mass times the position of the centre of mass.
    inertia : float
        Moment of inertia I about the rotation axis **through the reference point**, kg m^2.

    Raises
    ------
    ModelError
        If no real body has this inertia: the mass must be positive and I m >= (m gamma)^2.

    Examples
    --------
    >>> link = PlanarInertia.of_body(0.32, (0.0847, 0.01), 0.003099648)
    >>> link.first_moment
    (0.027104, 0.0032)
    """

    kinds: ClassVar = ("m", "mgx", "mgy", "I")

    @classmethod
    def shares_of_point(cls, x: Any, y: Any, z: Any) -> dict[str, Any]:
        """Return the parameters, by kind, of 1 kg at the point (x, y, z) of the body's frame."""
        return dict(zip(cls.kinds, (1, x, y, x * x + y * y), strict=True))


@dataclass(frozen=True)
class SpatialInertia:
    """The inertia of a body that turns about any axis, about its reference point, in its own frame.

    Parameters
    ----------
    mass : float
        Mass m, kg.
    first_moment : tuple of float
        (m gamma_x, m gamma_y, m gamma_z), kg m: mass times the position of the centre of mass.
    inertia : tuple of float
        (Ixx, Ixy, Ixz, Iyy, Iyz, Izz), entries of the inertia tensor **about the reference point**,
        kg m^2; Ixy is minus the integral of x y dm.

    Raises
    ------
    ModelError
        If no real body has this inertia: about the centre of mass no moment of inertia may be
        greater than the sum of the other two, nor below zero.

    Examples
    --------
    >>> body = SpatialInertia.of_body(2.0, (0.0, 0.0, 0.1), (0.05, 0.0, 0.0, 0.05, 0.0, 0.04))
    >>> body.first_moment
    (0.0, 0.0, 0.2)
    """

    mass: float
    first_moment: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    kinds: ClassVar = ("m", "mgx", "mgy", "mgz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", positive(self.mass, "mass", "kg"))
        for name, count in (("first_moment", 3), ("inertia", 6)):
            object.__setattr__(self, name, numbers(getattr(self, name), name, count))
        tensor = self.tensor
        # The second moments about the reference point exceed those of a point mass at the centre.
        h = np.array(self.first_moment)
        second = 0.5 * np.trace(tensor) * np.eye(3) - tensor - np.outer(h, h) / self.mass
        size = max(float(np.abs(tensor).max()), float(h @ h) / self.mass)
        if np.linalg.eigvalsh(second).min() < -EXACT * size or not np.trace(tensor) > 0.0:
            c = h / self.mass
            least = self.mass * (c @ c * np.eye(3) - np.outer(c, c))
            moments = [f"{v:.4g}" for v in np.linalg.eigvalsh(tensor - least)]
            raise ModelError(
                f"inertia: {list(self.inertia)} kg m^2 belongs to no real body; with this mass and "
                f"centre of mass its principal moments about that centre are {', '.join(moments)} "
                "kg m^2, of which none may be below 0 nor above the sum of the other two; is it "
                "about the centre of mass? It must be about the reference point, as [Ixx, Ixy, "
                "Ixz, Iyy, Iyz, Izz]"
            )

    @property
    def tensor(self) -> NDArray[np.float64]:
        """The inertia tensor about the reference point, (3, 3), kg m^2."""
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    @classmethod
    def second_moments(cls, values: Mapping[str, Any]) -> list[list[Any]]:
        """Return [[S, h], [h^T, m]] (4, 4) of parameters by kind, S the integral of r r^T dm.

        The matrix is linear in the ten parameters, and positive semidefinite for a real body.
        """
        x, y, z = values["Ixx"], values["Iyy"], values["Izz"]
        xy, xz, yz = -values["Ixy"], -values["Ixz"], -values["Iyz"]
        hx, hy, hz, m = values["mgx"], values["mgy"], values["mgz"], values["m"]
        half = 0.5 * (x + y + z)
        return [
            [half - x, xy, xz, hx],
            [xy, half - y, yz, hy],
            [xz, yz, half - z, hz],
            [hx, hy, hz, m],
        ]

    @classmethod
    def of_body(
        cls, mass: float, center_of_mass: Sequence[float], inertia: Sequence[float]
    ) -> SpatialInertia:
        """Build the inertia from mass, kg, centre of mass, m, and inertia tensor, kg m^2."""
        mass = positive(mass, "mass", "kg")
        x, y, z = numbers(center_of_mass, "center_of_mass", 3)
        xx, xy, xz, yy, yz, zz = numbers(inertia, "inertia", 6)
        return cls(mass, (mass * x, mass * y, mass * z), (xx, xy, xz, yy, yz, zz))

    @classmethod
    def shares_of_point(cls, x: Any, y: Any, z: Any) -> dict[str, Any]:
        """Return the parameters, by kind, of 1 kg at the point (x, y, z) of the body's frame."""
        tensor = y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y
        return dict(zip(cls.kinds, (1, x, y, z, *tensor), strict=True))

    @classmethod
    def of_values(cls, values: Sequence[float]) -> SpatialInertia:
        """Build the inertia from its ten parameters, in the order of `kinds`."""
        m, x, y, z, xx, xy, xz, yy, yz, zz = values
        return cls(m, (x, y, z), (xx, xy, xz, yy, yz, zz))

    @property
    def center_of_mass(self) -> tuple[float, ...]:
        """Position of the centre of mass in the body's frame, m."""
        return tuple(h / self.mass for h in self.first_moment)

    @property
    def values(self) -> tuple[float, ...]:
        """The ten inertial parameters, in the order of `kinds`."""
        return (self.mass, *self.first_moment, *self.inertia)

    def turned(self, rotation: NDArray[np.float64]) -> SpatialInertia:
        """Return the inertia in a rotated frame, in which a vector v becomes R v."""
        tensor = rotation @ self.tensor @ rotation.T
        x, y, z = (rotation @ self.first_moment).tolist()
        xx, xy, xz, yy, yz, zz = tensor[np.triu_indices(3)].tolist()
        return SpatialInertia(self.mass, (x, y, z), (xx, xy, xz, yy, yz, zz))


def inertia_count(kinds: Sequence[str]) -> int:
    """Return how many of these kinds of parameters belong to the inertia tensor."""
    return sum(kind.startswith("I") for kind in kinds)


def about_point(
    inertia: PlanarInertia | SpatialInertia, point: Sequence[float]
) -> PlanarInertia | SpatialInertia:
    """Return a body's inertia about another reference point, given in its frame, m.

    Examples
    --------
    >>> about_point(PlanarInertia.of_body(2.0, (0.1, 0.0), 0.05), (0.1, 0.0, 0.0)).values
    (2.0, 0.0, 0.0, 0.03)
    """
    kind = type(inertia)
    center = (*inertia.center_of_mass, 0.0)[:3]
    of_mass = kind.shares_of_point(*center).values()
    central = [i - inertia.mass * share for i, share in zip(inertia.values, of_mass, strict=True)]
    moved = [x - y for x, y in zip(center, point, strict=True)]
    count = inertia_count(kind.kinds)
    return kind.of_values(carried_values(kind, inertia.mass, moved, central[-count:]))


def carried_values(
    kind: type[PlanarInertia | SpatialInertia],
    mass: Any,
    center: Sequence[Any],
    inertia: Sequence[Any],
) -> list[Any]:
    """Return what a carried body adds to a platform's parameters, in the order of its kinds.

    `center` is the body's centre of mass in the platform's frame, m; `inertia` is about that
    centre: for a planar kind I about the platform's axis, for a spatial one Ixx, Ixy, Ixz, Iyy, Iyz
    and Izz. All may be expressions.
    """
    shares = kind.shares_of_point(*center).values()
    central = [0] * (len(shares) - len(inertia)) + list(inertia)
    return [mass * share + extra for share, extra in zip(shares, central, strict=True)]

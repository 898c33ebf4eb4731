"""Pydantic models of the bodies and vectors in TOML files.

They check shape and type only; the classes that they build, such as `RodInertia`, check whether the
numbers are those of a real body. A key's description appears in new files and the documentation.
The module is imported only where a file is read, as pydantic loads slowly.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from pteron.bodies.inertia import PlanarInertia, RodInertia, SpatialInertia
from pteron.errors import ModelError, shorten

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Count = Annotated[int, Field(ge=1, strict=True)]


def _only_x(entries: Any) -> Any:
    """Return a rod's centre-of-mass entries; raise unless they have x only."""
    if isinstance(entries, list) and len(entries) > 1:
        raise ValueError(f"{shorten(entries)} given, a list of 1 number expected: a rod has x only")
    return entries


One = Annotated[tuple[Number], BeforeValidator(_only_x)]
Two = tuple[Number, Number]
Three = tuple[Number, Number, Number]
Six = tuple[Number, Number, Number, Number, Number, Number]


def key(about: str, default: Any = ..., *example: Any) -> Any:
    """Return the pydantic field of a table's key, from description, default and example."""
    return Field(default, description=about, examples=list(example) or None)


class TomlTable(BaseModel):
    """A TOML table in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class Slider(TomlTable):
    """`{ mass }` of a body that does not turn."""

    mass: Number = Field(description="mass, kg")


class BarTable(TomlTable):
    """`{ mass, hinge }` of a part that moves with the platform and does not turn."""

    mass: Number = Field(description="mass, kg")
    hinge: Three = Field(
        description="place of its hinge on the part that turns, in the platform frame, m"
    )


class GearedTable(TomlTable):
    """`{ inertia, ratio }` of a part that a gear turns with the platform."""

    inertia: Number = Field(
        description="moment of inertia about its own axis, parallel to axis, kg m^2"
    )
    ratio: Number = Field(description="angle of the part divided by phi")


class _Body(TomlTable):
    mass: Number = Field(description="mass, kg")
    center_of_mass: Any = None
    first_moment: Any = None
    inertia: Any = Field(
        description="moment of inertia about the origin, not the centre of mass, kg m^2"
    )

    kind: ClassVar[type[PlanarInertia] | type[RodInertia] | type[SpatialInertia]]

    @property
    def unit(self) -> Any:
        """A body with mass and inertia 1, to replace an invalid one in further checks."""
        kinds = self.kind.kinds
        ones = ("m", "I", "Ixx", "Iyy", "Izz")
        return self.kind.of_values([float(kind in ones) for kind in kinds])

    def inertia_of(self, key: str) -> Any:
        """Build the inertia from the table; errors name keys with the prefix `key`."""
        try:
            if (self.center_of_mass is None) == (self.first_moment is None):
                present = "neither" if self.first_moment is None else "both"
                raise ModelError(
                    f"center_of_mass: {present} it and first_moment given; give one of the two"
                )
            if self.first_moment is not None:
                return self._build_from_first_moment()
            return self.kind.of_body(self.mass, self.center_of_mass, self.inertia)
        except ModelError as error:
            raise ModelError(f"{key}.{error}" if key else str(error)) from None

    def _build_from_first_moment(self) -> Any:
        """Build the inertia from the first moment; raise with advice if that is too large."""
        try:
            return self.kind(self.mass, self.first_moment, self.inertia)
        except ModelError as error:
            moment = list(self.first_moment)
            nothing: Any = (0.0,) * len(moment)
            try:
                self.kind(self.mass, nothing, self.inertia)
            except ModelError:
                raise error from None
        center = ", ".join(f"{component / self.mass:.4g}" for component in moment)
        raise ModelError(
            f"first_moment: {moment} kg m with a mass of {self.mass:g} kg puts the centre of mass "
            f"at ({center}) m, too far out for the inertia of {self.inertia} kg m^2; was mass "
            "edited alone? Write center_of_mass, which stays, in place of first_moment, and "
            "multiply inertia by what mass was multiplied by"
        )


_CENTER = "of the centre of mass in the body's frame, m"
_MOMENT = "mass times center_of_mass, kg m; instead of it"


class PlanarBody(_Body):
    """`{ mass, inertia, center_of_mass or first_moment }` of a body in a plane."""

    kind = PlanarInertia
    inertia: Number = Field(
        description="moment of inertia about the origin, not the centre of mass, kg m^2"
    )
    center_of_mass: Two | None = Field(None, description=f"[x, y] {_CENTER}")
    first_moment: Two | None = Field(None, description=_MOMENT)


class RodBody(_Body):
    """`{ mass, inertia, center_of_mass or first_moment }` of a rod, whose vectors have x only."""

    kind = RodInertia
    inertia: Number = Field(
        description="moment of inertia about the origin, not the centre of mass, kg m^2"
    )
    center_of_mass: One | None = Field(None, description=f"[x] {_CENTER}")
    first_moment: One | None = Field(None, description=_MOMENT)


class SpatialBody(_Body):
    """`{ mass, inertia, center_of_mass or first_moment }` of a body that turns about any axis."""

    kind = SpatialInertia
    inertia: Six = Field(
        description="[Ixx, Ixy, Ixz, Iyy, Iyz, Izz] of the tensor about the origin, not the centre "
        "of mass, kg m^2; Ixy is minus the integral of x y dm"
    )
    center_of_mass: Three | None = Field(None, description=f"[x, y, z] {_CENTER}")
    first_moment: Three | None = Field(None, description=_MOMENT)

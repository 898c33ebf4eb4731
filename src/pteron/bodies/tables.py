"""The parts of TOML tables that hold bodies and vectors, as pydantic reads them.

Only shape and type are checked here; what the numbers mean is checked by what they build. Imported
where a file is read, since pydantic would slow the start of those who read none.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from pteron.bodies.inertia import PlanarInertia, RodInertia
from pteron.errors import ModelError

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Count = Annotated[int, Field(ge=1, strict=True)]
One = tuple[Number]
Two = tuple[Number, Number]
Three = tuple[Number, Number, Number]


class Table(BaseModel):
    """A TOML table in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Slider(Table):
    """`{ mass }`."""

    mass: Number


class PlanarBody(Table):
    """`{ mass, inertia, center_of_mass or first_moment }` of a body in a plane."""

    mass: Number
    center_of_mass: Two | None = None
    first_moment: Two | None = None
    inertia: Number

    def inertia_of(self, key: str) -> PlanarInertia:
        """Build the inertia; `key` goes before what an error names."""
        return _built(self, PlanarInertia, key)


class RodBody(Table):
    """The same of a rod, whose vectors have one component."""

    mass: Number
    center_of_mass: One | None = None
    first_moment: One | None = None
    inertia: Number

    def inertia_of(self, key: str) -> RodInertia:
        """Build the inertia; `key` goes before what an error names."""
        return _built(self, RodInertia, key)


_Inertia = TypeVar("_Inertia", PlanarInertia, RodInertia)


def _built(body: PlanarBody | RodBody, kind: type[_Inertia], key: str) -> _Inertia:
    try:
        if (body.center_of_mass is None) == (body.first_moment is None):
            given = "neither" if body.first_moment is None else "both"
            raise ModelError(
                f"center_of_mass: {given} it and first_moment given; give one of the two"
            )
        moment: Any = body.first_moment
        center: Any = body.center_of_mass
        if moment is not None:
            return kind(body.mass, moment, body.inertia)
        return kind.of_body(body.mass, center, body.inertia)
    except ModelError as error:
        raise ModelError(f"{key}.{error}" if key else str(error)) from None

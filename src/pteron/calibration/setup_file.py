"""The TOML file beside a log of measurements: noise, marks, planes, anchors, the instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from pteron.bodies.tables import Number, Three, TomlTable
from pteron.bodies.vectors import unit_vector
from pteron.calibration.measurements import KINDS, Place, ReferencePlane, Setup
from pteron.errors import DataError, shorten
from pteron.tables import Dialect
from pteron.toml import read_toml, to_model

_ABSENT = "no such file; it should describe a log of measurements"

_OF_A_MANIPULATOR = {"platform", "legs"}
"""Keys by which a file is known to describe a machine."""


def _noise_by_kind(noise: Any) -> Any:
    """Return a mapping of noise by kind; a single number is the noise of every kind."""
    kinds = [kind for kind in KINDS if kind in NoiseTable.model_fields]
    return noise if isinstance(noise, dict) else dict.fromkeys(kinds, noise)


Noise = Annotated[Number, Field(gt=0.0)]


class NoiseTable(TomlTable):
    """`noise` by kind of value, m or rad."""

    position: Noise | None = Field(default=None, description="of x, y and z, m")
    angle: Noise | None = Field(default=None, description="of the pose's angles, rad")
    height: Noise | None = Field(default=None, description="m")
    distance: Noise | None = Field(default=None, description="m")
    readings: Noise | None = Field(default=None, description="of the joints' readings, m or rad")


class MeasuredTable(TomlTable):
    """`[measured]`: how exactly."""

    noise: Annotated[NoiseTable, BeforeValidator(_noise_by_kind)] = Field(
        default_factory=NoiseTable,
        description="standard deviation: one number for all that was measured, or one by kind",
    )


class PlaceTable(TomlTable):
    """`[marks.NAME]` on the platform, `[anchors.NAME]` in the base frame."""

    at: Three = Field((0.0, 0.0, 0.0), description="m; where free, where it is sought from")
    free: bool = Field(default=False, description="whether it is found with the geometry")

    @model_validator(mode="after")
    def _somewhere(self) -> PlaceTable:
        """Return the place; raise unless it has coordinates or is free."""
        if not self.free and "at" not in self.model_fields_set:
            raise ValueError("neither at nor free = true given; a place is known or found")
        return self


class PlaneTable(TomlTable):
    """`[planes.NAME]`: normal . p = offset in the base frame."""

    known: bool = Field(default=True, description="false: it is found with the geometry")
    normal: Annotated[Three, AfterValidator(lambda v: unit_vector(v, "normal"))] = Field(
        (0.0, 0.0, 1.0), description="unit vector along which heights grow"
    )
    offset: Number = Field(default=0.0, description="m")


class InstrumentTable(TomlTable):
    """`[instrument]`: what measured positions and angles."""

    frame: Literal["known", "unknown"] = Field(
        default="known", description='"known": it measures in the base frame'
    )


class G33Table(TomlTable):
    """`[g33]`: what a report of Marlin's G33 leaves out."""

    radius: Annotated[Number, Field(gt=0.0)] | None = Field(
        default=None, description="on which it probed, m"
    )


class MeasuredLog(TomlTable):
    """The whole file; each table may be left out."""

    csv: Dialect | None = None
    measured: MeasuredTable = Field(default_factory=MeasuredTable)
    marks: dict[str, PlaceTable] = Field(default_factory=dict)
    planes: dict[str, PlaneTable] = Field(default_factory=dict)
    anchors: dict[str, PlaceTable] = Field(default_factory=dict)
    instrument: InstrumentTable = Field(default_factory=InstrumentTable)
    g33: G33Table = Field(default_factory=G33Table)

    def setup(self) -> Setup:
        """Return the setup of the measurements: noise, marks, planes, anchors, frame."""

        def places(tables: dict[str, PlaceTable]) -> dict[str, Place]:
            """Return places by name from their tables; known unless a table says `free`."""
            return {name: Place(table.at, not table.free) for name, table in tables.items()}

        return Setup(
            self.measured.noise.model_dump(exclude_none=True),
            places(self.marks),
            {name: ReferencePlane(p.normal, p.offset, p.known) for name, p in self.planes.items()},
            places(self.anchors),
            self.instrument.frame == "known",
        )


def read_setup_file(log: str | Path) -> MeasuredLog:
    """Return the TOML file beside a log, of the same stem; empty if there is none.

    Raises
    ------
    DataError
        If it is not TOML, has unknown keys or impossible values; all faults are reported at once.
    """
    path = Path(log).with_suffix(".toml")
    if not path.is_file():
        return MeasuredLog()
    document = read_toml(path, DataError, _ABSENT)
    if document.keys() >= _OF_A_MANIPULATOR:
        return MeasuredLog()
    return to_model(MeasuredLog, document, shorten(str(path), bare=True, longest=1000), DataError)


def join_setups(setups: Sequence[Setup], sources: Sequence[str]) -> Setup:
    """Return the merged setup of several logs; raise where they contradict each other.

    Raises
    ------
    DataError
        If one name, or the frame, means different things in two of them.
    """
    setup, *others = setups
    for other, source in zip(others, sources[1:], strict=True):
        if other.frame_known != setup.frame_known:
            raise DataError(f"{source}: another instrument.frame than in {sources[0]}; give one")
        for part in ("noise", "marks", "planes", "anchors"):
            old, new = getattr(setup, part), getattr(other, part)
            for name in old.keys() & new.keys():
                if old[name] != new[name]:
                    raise DataError(
                        f"{source}: {part}.{shorten(name, bare=True)}: another than in an earlier "
                        "log; make them one, or rename one"
                    )
            changed: dict[str, Any] = {part: {**old, **new}}
            setup = replace(setup, **changed)
    return setup

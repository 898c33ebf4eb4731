"""Groups of options of `pteron cue`: its filters, and a live cue's sockets and formats."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pteron.motion import Washout


@dataclass(frozen=True)
class FilterOptions:
    """The options of the filters; None where one is left out."""

    scale: float | None = None
    translation: float | None = None
    return_speed: float | None = None
    tilting: float | None = None
    tilt_rate: float | None = None
    rotation: float | None = None
    smoothing: float | None = None

    def washout(self) -> Washout:
        """Return the filters."""
        from pteron.motion import Washout

        return Washout(
            **{name: number for name, number in asdict(self).items() if number is not None}
        )


@dataclass(frozen=True)
class LiveOptions:
    """The options of a live cue."""

    listen: int | None = None
    send: str | None = None
    layout: str = "json"
    flip: str | None = None
    set_points: str = "csv"
    timeout: float = 0.3
    duration: float | None = None
    host: str = "127.0.0.1"

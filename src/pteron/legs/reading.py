"""The reading of an actuated joint: its coordinate as the drive counts it."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.bodies.vectors import number
from pteron.errors import ModelError
from pteron.toml import told


@dataclass(frozen=True)
class Reading:
    """The relation of a joint's coordinate to what its drive reads: q = zero + scale reading.

    Calibration writes it where the leg's geometry cannot take a zero or a scale.

    Parameters
    ----------
    zero : float
        The coordinate where the drive reads 0, m or rad.
    scale : float
        Metres, or radians, of the coordinate per unit of the reading; not 0.
    """

    zero: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        faults: list[str] = []
        for name in ("zero", "scale"):
            try:
                object.__setattr__(self, name, number(getattr(self, name), name))
            except ModelError as error:
                faults += error.faults
        if self.scale == 0.0:
            faults.append("scale: 0 given, another number expected")
        if faults:
            raise ModelError(told(faults), faults=faults)

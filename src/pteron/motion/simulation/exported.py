"""`Exported`: a controller by its exported C, as it runs on the machine (software in the loop)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pteron.controllers import Controller, Custom
from pteron.controllers.custom import CustomLaw
from pteron.controllers.law import Law
from pteron.errors import DataError
from pteron.kernels.loop_code import LinkedLaw
from pteron.manipulator import RobotLike
from pteron.manipulator.readings import reading_scales, reading_zeros
from pteron.tolerances import ROUNDING


@dataclass(frozen=True)
class ExportedLaw(Law):
    """A law whose forces come from exported C."""

    linked: LinkedLaw | None = None


@dataclass(frozen=True, eq=False)
class ExportedCustomLaw(CustomLaw):
    """A custom law whose forces come from exported C."""

    linked: LinkedLaw | None = None


@dataclass(frozen=True)
class Exported:
    """A controller whose exported C is compiled into the loop of `simulate`, unmodified.

    The numbers are those of its tables, as on the machine: gains, inertial parameters, drives; the
    `model` of `simulate` says only what memory begins with, and what the drives read where they do
    not count the joint coordinates.

    Parameters
    ----------
    folder : path
        What `pteron.export_c(robot, [controller], folder)` wrote.
    controller : Controller or Custom
        Whose law it is, with its period.

    Raises
    ------
    DataError
        If the folder has no C of the law, one of single precision, one that commands motors, or one
        for another period.

    Examples
    --------
    >>> import tempfile, pteron
    >>> from pteron.controllers import ComputedTorque
    >>> from pteron.motion import Exported
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = pteron.export_c("tripteron", [ComputedTorque()], folder)
    ...     controller = Exported(folder, ComputedTorque())
    >>> controller.period
    0.001
    """

    folder: str | Path
    controller: Controller | Custom

    def __post_init__(self) -> None:
        if not isinstance(self.controller, Controller | Custom):
            raise DataError(
                f"controller: {self.controller!r} given, one of pteron.controllers expected"
            )
        object.__setattr__(self, "_text", self._read_code())

    @property
    def period(self) -> float:
        """Sampling period of the controller, s."""
        return self.controller.period

    def law(self, model: RobotLike) -> ExportedLaw | ExportedCustomLaw:
        """Return the control law that runs the exported C code inside a simulation's loop."""
        plain_law, law_name = self.controller.law(model), self.controller.law_name
        header, source, function = self._text  # type: ignore[attr-defined]
        tables = []
        for port in plain_law.program.inputs:
            if port.shared:
                stem = function.removesuffix(law_name)
                names = (f"{function}_{port.name}", f"{stem}{port.name}")
                names_there = [
                    name for name in names if re.search(rf"extern const double {name}\[", header)
                ]
                if not names_there:
                    raise DataError(
                        f"{self.folder}: no table {names[1]} there; export the controller without "
                        "--specialised, for this machine"
                    )
                size = int(re.search(rf"{names_there[0]}\[(\d+)\]", header)[1])  # type: ignore[index]
                if size != port.size:
                    raise DataError(
                        f"{self.folder}: {names_there[0]} has {size} numbers, {port.size} "
                        "expected; export the controller for this machine"
                    )
                tables.append((port.name, names_there[0]))
                self._expect_period(source, names_there[0])
        zeros, scales = (
            reading_zeros(plain_law.model).tolist(),
            reading_scales(plain_law.model).tolist(),
        )
        linked = LinkedLaw(header + source, function, tuple(tables), tuple(zeros), tuple(scales))
        if isinstance(plain_law, CustomLaw):
            return ExportedCustomLaw(plain_law.controller, plain_law.model, linked)
        return ExportedLaw(plain_law.what, plain_law.model, plain_law.gains, plain_law.base, linked)

    def _expect_period(self, source: str, table: str) -> None:
        """Raise if the exported C code's gains are for another sampling period."""
        period_match = re.search(
            rf"\b{table}\[\d+\] = {{[^}}]*?([-+.\w]+),?\s*/\* period \*/", source
        )
        if period_match and abs(float(period_match[1]) - self.period) > ROUNDING * self.period:
            raise DataError(
                f"{self.folder}: {table} is for a period of {float(period_match[1]):g} s, the "
                f"controller's is {self.period:g} s; export it again, or give the controller that "
                "period"
            )

    def _read_code(self) -> tuple[str, str, str]:
        """Return the exported header, the source without that include, the function's name."""
        law_name = self.controller.law_name
        for path in sorted(Path(self.folder).glob("*.h")):
            header = path.read_text(encoding="utf-8")
            signature = re.search(rf"\bint (\w+_{law_name})\((\w+ )*(double|float)", header)
            if signature and path.with_suffix(".c").exists():
                if signature[3] == "float":
                    raise DataError(
                        f'{path}: numbers of single precision; export with real="double"'
                    )
                if not re.search(rf"{signature[1]}\([^)]*\bforces\b", header):
                    raise DataError(
                        f"{path}: {law_name} gives commands of the motors; export with "
                        'output="force"'
                    )
                source = path.with_suffix(".c").read_text(encoding="utf-8")
                return header, re.sub(r'#include "[^"]*"', "", source), signature[1]
        raise DataError(
            f"{self.folder}: no C of {law_name} there; write it with pteron.export_c(robot, "
            "[controller], folder)"
        )

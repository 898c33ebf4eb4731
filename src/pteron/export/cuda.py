"""Export of CUDA: device functions, kernels with a launcher for C++, and a module for Python.

The functions are those of `export_c`, with their status, and have its bits where products and sums
are not contracted to fused operations (nvcc's `--fmad=false`) but for arctangents. The module needs
NumPy and CuPy alone.
"""

from __future__ import annotations

import re
from pathlib import Path

from pteron.export.c import Real, source_variables
from pteron.export.command_units import Output
from pteron.export.functions import FunctionChoice, exported_functions
from pteron.export.names import prefix_of
from pteron.export.writing import write_export
from pteron.kernels.code import render_template
from pteron.manipulator import RobotLike, as_manipulator

_MACROS = re.compile(r"\bis(?=(?:less|lessequal|greaterequal)\()")
"""C's comparisons: macros of math.h, in C++ functions that a GPU does not have."""


def export_cuda(
    robot: RobotLike,
    functions: FunctionChoice | None = None,
    folder: str | Path = ".",
    *,
    real: Real = "double",
    specialised: bool = False,
    wrench: bool = False,
    output: Output = "force",
    base: str | Path | None = None,
) -> list[Path]:
    """Write CUDA for a machine: a header, kernels with a launcher, and a module of Python.

    `NAME.cuh` has device functions, which kernels of one's own call with the arrays of one state.
    `NAME.cu` has a kernel for each, one thread a state, and a function of C++ that launches it.
    `NAME_cuda.py` compiles and launches them from Python, on arrays of CuPy, PyTorch or JAX, with
    NumPy and CuPy alone. All return a status for each state, as the functions of `export_c`.

    Parameters
    ----------
    robot, functions, folder, real, specialised, wrench, output, base
        As `export_c` has them.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ModelError
        If a function's name is unknown, or `real` or `output` is; if a drive lacks what the output
        needs.
    DataError
        If `base` is no identification of this machine.
    OutputError
        If the folder cannot be written.

    Examples
    --------
    >>> import pteron, tempfile
    >>> from pteron.export import export_cuda
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = export_cuda(pteron.load("quadrupteron"), ["inverse_kinematics"], folder)
    >>> sorted(path.name for path in files)
    ['quadrupteron.cu', 'quadrupteron.cuh', 'quadrupteron_cuda.py']
    """
    robot = as_manipulator(robot)
    exported = exported_functions(
        robot, functions, specialised=specialised, wrench=wrench, output=output, base=base
    )
    variables, prefix = source_variables(robot, exported, real, "CUDA"), prefix_of(robot)
    files = {f"{prefix}.cuh": "device.cuh.j2", f"{prefix}.cu": "kernels.cu.j2"}
    files[f"{prefix}_cuda.py"] = "cuda.py.j2"
    texts = {
        file: render_template("pteron.export", name, **variables) for file, name in files.items()
    }
    texts[f"{prefix}.cuh"] = _MACROS.sub(f"{prefix}_is", texts[f"{prefix}.cuh"])
    return write_export(folder, texts)

"""Numbers of a machine's tools as `set_payload` takes them: constants of C, lines of a comment."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pteron.bodies.inertia import inertia_count
from pteron.export.names import add_checksum, safe_name
from pteron.kernels import Array
from pteron.manipulator import Manipulator, Tool

_TENSOR = "Ixx Ixy Ixz Iyy Iyz Izz"


def tool_tables(robot: Manipulator) -> Iterator[tuple[str, str, tuple[str, ...], Array]]:
    """Yield each tool's mass, centre of mass and inertia as constants: arguments of a call.

    Each is a name, a comment, a comment for each number, and the numbers.
    """
    taken: set[str] = set()
    for tool in robot.tools:
        stem = f"tool_{safe_name(tool.name, '_')}"
        stem = add_checksum(stem, tool.name, len(stem) + 7) if stem in taken else stem
        taken.add(stem)
        for name, numbers in _arguments(robot, tool).items():
            units = {"mass": ("kg",), "center": ("x, m", "y, m", "z, m")}.get(name)
            kinds = _TENSOR.split() if len(numbers) > 1 else ["I"]
            units = units or tuple(f"{kind}, kg m^2" for kind in kinds)
            yield f"{stem}_{name}", f"{_tool_text(tool)}: {name} of set_payload.", units, numbers


def tool_lines(robot: Manipulator) -> list[str]:
    """Return a line for each tool: the arguments of `set_payload` while it is mounted."""
    lines = []
    for tool in robot.tools:
        arguments = (
            f"{name} := [{', '.join(map(repr, numbers.tolist()))}]"
            for name, numbers in _arguments(robot, tool).items()
        )
        lines.append(f"{_tool_text(tool)}: {', '.join(arguments)}.")
    return lines


def _arguments(robot: Manipulator, tool: Tool) -> dict[str, Array]:
    """Return a tool's mass, centre and inertia as arrays, as `set_payload` takes them."""
    count = inertia_count(robot.platform.inertia.kinds)
    inertia = np.zeros(count) + np.array(tool.central_inertia)
    return {"mass": np.array([tool.mass]), "center": np.array(tool.center), "inertia": inertia}


def _tool_text(tool: Tool) -> str:
    """Return a tool's name and point for a comment, which the name cannot end."""
    name = "".join(c if " " <= c <= "~" and c not in "*()" else "?" for c in tool.name)
    return f"Tool {name}, its centre point at {' '.join(f'{x:g}' for x in tool.point)} m"

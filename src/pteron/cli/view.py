"""`pteron view`: a page in the browser on which a machine can be moved."""

from __future__ import annotations

import os
import sys
import webbrowser
from contextlib import suppress
from threading import Event
from typing import Any

from typer import echo

from pteron.cli.arguments import MachineArgument, about_pivot, load_robot
from pteron.cli.motion_argument import Carried
from pteron.cli.progress import spinner
from pteron.cli.terminal import note, show_json

_TICK = 0.5
"""Time between two checks for Ctrl-C, s: some systems deliver it only then."""


def view(
    machine: MachineArgument,
    *,
    motion: str | None = None,
    carried: Carried,
    pivot: str | None = None,
    compare: str | None = None,
    enlarge: float | None = None,
    beside: list[str] | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    no_browser: bool = False,
    json: bool = False,
) -> None:
    """Show a machine in the browser, where it can be moved; Ctrl-C ends it.

    Sliders and the mouse move the platform or the joints, or a spring pulls at it; the page shows
    the drives' forces, the condition number, the distances from singularities and limits, and
    slices of the workspace, and plays motions, logs and simulations. See docs/view.md.

    Options
    -------
    --motion CYCLE: Play adept, the standard pick-and-place cycle, or a file: a motion, a simulation
        or a log.
    --compare ROBOT: Another machine with legs of the same kind, in grey in the same pose.
    --enlarge TIMES: Factor by which differences of the compared machine are enlarged. [default:
        chosen so that they are visible]
    --beside ROBOT: Another machine beside the first; repeat for several.
    --host: Address of the server; the default is reachable from this computer alone.
    --port: Port of the server, or the next free one; 0 is any.
    --no-browser: Print the address without opening a browser.

    Examples
    --------
    pteron view delta
    pteron view quadrupteron --motion adept --payload 0.5
    pteron view robot.toml --motion log.csv --port 9000 --no-browser
    pteron view calibrated/robot.toml --compare robot.toml --enlarge 50
    pteron view delta --beside par4 --beside hexa --motion adept
    """
    if carried.payload_center is None:
        machine = about_pivot(carried.mount_tool(machine), pivot)
    else:  # the page's own payload is at the tool
        machine, carried = about_pivot(carried.load_machine(machine), pivot), Carried()
    with spinner(f"Preparing {machine.name}"):
        from pteron.viewer import view as opened
        from pteron.viewer.guard import is_local_address

        shown: Any = {
            "motion": motion,
            "payload": carried.payload,
            "compare": compare and about_pivot(load_robot(compare), pivot),
            "enlarge": enlarge,
            "beside": [about_pivot(load_robot(name), pivot) for name in beside or ()],
        }
        viewer = opened(machine, host=host, port=port, **shown)
    # Ctrl-C is the usual way to end it.
    with viewer, suppress(KeyboardInterrupt):
        if port not in (0, viewer.port):
            note(f"Note: port {port} is in use; the page is at {viewer.port}")
        if not is_local_address(host):
            note(
                f"Warning: --host {host}: anyone who can reach this machine over the network can "
                "see the page, move the picture and load files into it, without a password"
            )
        if json:
            show_json({"robot": machine.name, "url": viewer.url, "port": viewer.port})
        else:
            echo(f"{machine.name} is at {viewer.url} (Ctrl-C ends it)")
        sys.stdout.flush()
        if not no_browser and _has_screen():
            webbrowser.open(viewer.url)
        never = Event()
        while not never.wait(_TICK):
            pass


def _has_screen() -> bool:
    """Return whether a person may see a browser that is opened here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))

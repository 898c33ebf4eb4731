"""`pteron tune`: gains of a controller with stated stability margins, and a page on them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import STANDARD, MachineArgument, check_rate, parsed_list
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.simulate import Name, controller_of
from pteron.cli.terminal import plain, show, table

if TYPE_CHECKING:
    import polars as pl

    from pteron.motion import Tuning

_SHARES = 0.25, 0.5, 1.0, 1.4
"""Bandwidths of the trials, of the one chosen."""

_DELAYS = 0.0, 0.5, 1.0, 2.0
"""Delays of the trials, in samples, beyond the given one."""

_STIFFNESSES = 0.5, 2.0
"""Stiffness of transmissions that bend in the trials, over the file's."""

_ENCODERS = "0,1e-6,1e-5,1e-4"
"""Steps of encoders of the trials."""


def tune(
    machine: MachineArgument,
    *,
    cycle: str = STANDARD,
    controller: Name = "feed-forward",
    carried: Carried,
    duration: float | None = None,
    rate: float = 1000.0,
    bandwidth: float | None = None,
    gain_margin: float = 2.0,
    phase_margin: float = 45.0,
    delay_margin: float = 0.0,
    encoder: float = 0.0,
    cutoff: float | None = None,
    delay: float = 0.0,
    encoders: str = _ENCODERS,
    out: str | None = None,
) -> CommandResult:
    """Choose gains of a controller with stability margins that hold in a cycle and the workspace.

    The loop of machine, drives, encoders, controller and delay is linearised at moments of the
    cycle and at poses of the workspace, with all coupling of the closed chain; from sample to
    sample it is exact. The greatest bandwidth is chosen that has the margins everywhere, with more
    damping where none has. Transmissions that bend and currents that lag, as the drives in the
    robot's file say, are in it. Then the cycle is simulated with other bandwidths, delays, encoders
    and, where transmissions bend, stiffnesses.

    A folder gets gains.toml, which pteron simulate, pteron export and
    pteron.controllers.read_gains take, tuning.html, tuning.csv with the margins of each pose, and
    tuning.json.

    Options
    -------
    --controller: Whose gains; see docs/controllers.md.
    --rate: Samples of the controller a second.
    --bandwidth: Take this one, rad/s; refused where it has not the margins.
    --gain-margin: Factor on a drive's force, or on all, at which the loop becomes unstable.
    --phase-margin: At each drive, degrees.
    --delay-margin: Further delay, s, beyond --delay; 0 asks for none.
    --encoder: Step of the encoders at the joints, m or rad; rates are then differences.
    --cutoff: Of the filter on these rates, Hz. [default: no filter]
    --delay: From a sample to the drives' force, s.
    --encoders STEPS: Steps of the encoders in the trials, m or rad.
    --out DIR|FILE: Write gains, margins and page to a folder, or the table of margins to a file.

    Examples
    --------
    pteron tune delta --out tuned
    pteron tune robot.toml --cycle motion.csv --rate 4000 --delay 2.5e-4 --encoder 1e-5 --out tuned
    pteron simulate delta --gains tuned/gains.toml
    """
    import numpy as np

    from pteron.motion import Required, Sensors, trials, tune as tuned
    from pteron.motion.tuning.trials import bends

    check_rate(rate)
    steps = parsed_list(encoders, "--encoders") or []
    required = Required(gain_margin, float(np.radians(phase_margin)), delay_margin)
    sensors = Sensors(encoder=encoder, cutoff=cutoff)
    destination = Destination(out, "tuning")
    destination.check()
    machine = carried.load_machine(machine)
    how: dict[str, Any] = {"sensors": sensors, "delay": delay}
    with spinner(f"Tuning {machine.name}"):
        motion = cycle_of(machine, cycle, duration)
        acts = controller_of(controller, motion, 1.0 / rate, bandwidth)
        tuning = tuned(machine, motion, acts, required=required, **how)
        best = float(np.max(tuning.controller.bandwidth or 0.1 * rate))
        tried = trials(
            machine,
            motion,
            tuning.controller,
            bandwidths=[best * share for share in _SHARES if best * share < np.pi * rate],
            delays=[delay + late / rate for late in _DELAYS],
            encoders=steps,
            stiffnesses=_STIFFNESSES if bends(machine) else (),
            **how,
        )
    record = {
        "robot": machine.name,
        "cycle": cycle,
        "controller": controller,
        "rate": rate,
        "bandwidth": tuning.controller.bandwidth,
        **tuning.gains(),
        "margins": tuning.least,
        "poses": len(tuning.states),
        "trials": tried.to_dicts(),
    }
    person = partial(_show, tuning, controller, tried)
    return destination.deliver(tuning.table(), record, partial(_files, tuning, tried), person)


def _files(tuning: Tuning, tried: pl.DataFrame) -> dict[str, str]:
    """Return the texts of the tuning's files, by name: gains in TOML, and the page."""
    from pteron.controllers import gains_text
    from pteron.report.tuning_page import tuning_page

    return {
        "gains.toml": gains_text(tuning.robot, tuning.controller, tuning.least),
        "tuning.html": tuning_page(tuning, tried),
    }


def _show(tuning: Tuning, controller: str, tried: pl.DataFrame) -> None:
    """Print the gains, the least margins, and the trials."""
    import numpy as np

    least, gains = tuning.least, tuning.gains()
    rows = zip(tuning.robot.joint_names, *gains.values(), strict=True)
    unit = "urad" if tuning.robot.platform.angular.all() else "um"
    tries = [
        (
            *(row["changed"], f"{row['value']:.4g}"),
            *(
                ("ended early", "", "", "")
                if row["stopped"]
                else (
                    f"{1e6 * row['error']:.3g} {unit}",
                    "does not" if np.isnan(row["settling"]) else f"{1e3 * row['settling']:.3g} ms",
                    f"{row['peak_force']:.4g}",
                    f"{row['energy']:.4g} J",
                )
            ),
        )
        for row in tried.to_dicts()
    ]
    names = ("changed", "value", "greatest error", "settled after", "peak force", "energy")
    rate = tuning.controller.bandwidth
    chosen = "" if rate is None else f", {np.max(rate):.4g} rad/s"
    show(
        f"[bold]{plain(tuning.robot.name)}[/bold], {controller}{chosen}: at {len(tuning.states)} "
        f"poses a gain margin of {least['gain']:.3g}, {np.degrees(least['phase']):.3g} degrees, "
        f"{1e3 * least['delay']:.3g} ms; disk margin {least['disk']:.3g}",
        table(
            "joint",
            *gains,
            rows=((name, *(f"{g:.6g}" for g in joint_gains)) for name, *joint_gains in rows),
        ),
        table(*names, rows=tries, numbers=names[1:]),
    )

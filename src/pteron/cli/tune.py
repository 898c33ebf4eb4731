"""`pteron tune`: gains of a controller with stated stability margins, and a page on them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pteron.cli.arguments import (
    STANDARD,
    MachineArgument,
    about_pivot,
    check_rate,
    parsed_list,
)
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.simulate import Name, controller_of
from pteron.cli.terminal import plain, show, significant, table

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
    out: str | None = None,
    controller: Name = "feed-forward",
    carried: Carried,
    pivot: str | None = None,
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
) -> CommandResult:
    """Choose a controller's gains, with stability margins in a cycle and the workspace.

    The loop of machine, drives, encoders, controller and delay is linearised at moments of the
    cycle and at poses of the workspace, with all coupling of the closed chain, and discretised
    exactly. The result is the largest bandwidth that has the margins at all of them; if none has,
    damping is increased. Elastic transmissions and lagging currents, as the drives in the robot's
    file state them, are included. Then the cycle is simulated with other bandwidths, delays,
    encoders and, for elastic transmissions, stiffnesses.

    A folder gets gains.toml, which pteron simulate, pteron export and
    pteron.controllers.read_gains take, tuning.html, tuning.csv with the margins of each pose, and
    tuning.json.

    Options
    -------
    --out DIR|FILE: Write gains, margins and page to a folder, or the table of margins to a file.
    --controller: Control law to tune; see docs/controllers.md.
    --rate: Sample rate of the controller, Hz.
    --bandwidth: Use this bandwidth, rad/s; an error if it lacks the margins.

    Margins
    -------
    --gain-margin: Required factor on one drive's force, or on all, before the loop is unstable.
    --phase-margin: Required phase margin at each drive, degrees.
    --delay-margin: Required further delay, s, beyond --delay; 0 requires none.

    Sensors
    -------
    --encoder: Resolution of the joints' encoders, m or rad; rates are then differences.
    --cutoff: Cut-off of the filter on these rates, Hz. [default: no filter]
    --delay: Delay from a sample to the drives' force, s.
    --encoders STEPS: Resolutions of the encoders in the trials, m or rad.

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
    machine = about_pivot(carried.load_machine(machine), pivot)
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


_TRIED = {
    "bandwidth": ("controller bandwidth (rad/s)", 1.0),
    "delay": ("delay (ms)", 1e3),
    "encoder": ("encoder step (u{unit})", 1e6),
    "stiffness": ("transmission stiffness over the file's", 1.0),
}
"""Quantities that the trials change, in words with the unit, and the factor to that unit."""


def _show(tuning: Tuning, controller: str, tried: pl.DataFrame) -> None:
    """Print the gains, the least margins beside the required ones, and the trials."""
    import numpy as np

    from pteron.report.tuning_page import force_units, gain_units

    robot, least, gains = tuning.robot, tuning.least, tuning.gains()
    rows = zip(robot.joint_names, *gains.values(), strict=True)
    units = (unit.replace("\u00b2", "^2") for unit in gain_units(tuning))
    headings = [f"{n} ({unit})" if unit else n for n, unit in zip(gains, units, strict=True)]
    unit = "urad" if robot.platform.angular.all() else "um"
    joint_unit = "/".join(dict.fromkeys(leg.joint.unit for leg in robot.legs))
    tries, changed = [], ""
    for row in tried.to_dicts():
        name, factor = _TRIED[row["changed"]]
        figures = (
            ("ended early", "", "", "")
            if row["stopped"]
            else (
                f"{significant(1e6 * row['error'])} {unit}",
                "never" if np.isnan(row["settling"]) else f"{1e3 * row['settling']:.3g} ms",
                significant(row["peak_force"]),
                f"{significant(row['energy'])} J",
            )
        )
        first = "" if row["changed"] == changed else name.format(unit=joint_unit)
        changed = row["changed"]
        tries.append((first, f"{factor * row['value']:.3g}", *figures))
    force = f"peak force ({' or '.join(force_units(robot))})".replace("(share)", "/limit")
    names = ("simulated with", "value", "largest error", "settling time", force, "energy")
    rate, required = tuning.controller.bandwidth, tuning.required
    bandwidth = "" if rate is None else f", bandwidth {np.max(rate):.3g} rad/s"
    show(
        f"[bold]{plain(robot.name)}[/bold]: gains found for controller {controller}{bandwidth}. "
        f"Smallest stability margins at {len(tuning.states)} poses (required): "
        f"gain {least['gain']:.3g} ({required.gain:g}), "
        f"phase {np.degrees(least['phase']):.3g} deg ({np.degrees(required.phase):.3g}), "
        f"delay {1e3 * least['delay']:.3g} ms ({1e3 * required.delay:g}), "
        f"disk margin {least['disk']:.3g} (errors of gain and phase in all drives; 0 is unstable).",
        table(
            *("joint", *headings),
            rows=((name, *(significant(g, 4) for g in joint_gains)) for name, *joint_gains in rows),
            numbers=tuple(headings),
        ),
        "The cycle simulated with these gains, one parameter changed at a time:",
        table(*names, rows=tries, numbers=names[1:]),
    )

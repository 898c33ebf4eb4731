"""`pteron simulate`: a machine with its drives follows a cycle under a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from pteron.cli.arguments import STANDARD, MachineArgument, about_pivot, check_rate, load_robot
from pteron.cli.destination import Destination
from pteron.cli.motion_argument import Carried, cycle_of, cycle_text
from pteron.cli.motion_table import force_word
from pteron.cli.progress import spinner
from pteron.cli.result import CommandResult
from pteron.cli.terminal import (
    is_terminal,
    note,
    percent,
    plain,
    show,
    significant,
    table,
    warn,
    write,
)
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.controllers import Controller
    from pteron.manipulator import Manipulator
    from pteron.motion import Motion, Simulation

_ENDED = 1
"""Exit code where the simulation ended before its time."""

Name = Literal["computed-torque", "feed-forward", "pd", "adaptive", "adaptive-drives"]
"""Names of controllers."""


def simulate(
    machine: MachineArgument,
    *,
    cycle: str = STANDARD,
    out: str | None = None,
    controller: Name = "computed-torque",
    gains: str | None = None,
    bandwidth: float | None = None,
    rate: float = 1000.0,
    carried: Carried,
    pivot: str | None = None,
    cycles: int = 1,
    duration: float | None = None,
    model: str | None = None,
    anyway: bool = False,
    encoder: float = 0.0,
    delay: float = 0.0,
    step: float = 1e-4,
    method: Literal["rk4", "dop853"] = "rk4",
    elbows: str | None = None,
) -> CommandResult:
    """Simulate a machine with its drives under a controller.

    The rigid bodies with the payload, and the drives with friction and rotors, move under the
    forces that the controller commands, held from sample to sample; no drive exceeds its max_force.
    A cycle beyond what the drives can do is refused, with the leg and by how much.

    The table has a row for each sample: t, the pose x y z phi, its rates and accelerations, the
    reference (xref ...), the joints and their rates, forces, and the payload. A folder gets
    simulation.csv, simulation.json, tracking.svg and forces.svg. The exit code is 1 if the
    simulation stops before the end of the cycle, and a note says why.

    Options
    -------
    --out DIR|FILE: Write a table and figures to a folder, or the table to a file.
    --controller: Control law; see docs/controllers.md.
    --gains FILE: Use the controller in pteron tune's gains.toml, with its law, gains and rate.
    --bandwidth: Bandwidth of the controller, rad/s. [default: a tenth of the rate]
    --rate: Sample rate of the controller, Hz.
    --cycles: Number of cycles, one after the other.
    --model ROBOT: Model of the machine in the controller. [default: the machine, with its payload]
    --anyway: Simulate even a cycle beyond what the drives can do.

    Sensors
    -------
    --encoder: Resolution of the joints' encoders, m or rad; 0 is exact.
    --delay: Delay from a sample to the drives' force, s.

    Integration
    -----------
    --step: Step of the integration, s.
    --method: Integrator: compiled Runge-Kutta of fixed step (rk4), or SciPy's DOP853.

    Examples
    --------
    pteron simulate delta --payload 1.0
    pteron simulate robot.toml --controller adaptive --model drawing.toml --cycles 10 --out run
    pteron simulate quadrupteron --cycle motion.csv --encoder 1e-6 --delay 5e-4 --out run.csv
    """
    from pteron.controllers import read_gains
    from pteron.motion import Sensors, simulate as simulated
    from pteron.motion.overloads import overloads_of

    if gains is not None and bandwidth is not None:
        raise DataError("--gains, --bandwidth: both given; leave one of them out")
    if cycles < 1:
        raise DataError(f"--cycles: {cycles} given, 1 or more expected")
    check_rate(rate)
    destination = Destination(out, "simulation")
    destination.check()
    carrying = about_pivot(carried.load_machine(machine), pivot)
    at_tool = carried.payload_center is None
    machine = about_pivot(carried.mount_tool(machine), pivot) if at_tool else carrying
    believed = None if model is None else about_pivot(_model(machine, model, elbows), pivot)
    with spinner(f"Simulating {machine.name}"):
        motion = cycle_of(machine, cycle, duration)
        acts, law_name = controller_of(controller, motion, 1.0 / rate, bandwidth), str(controller)
        if gains is not None:
            acts, law_name = read_gains(carrying, gains), gains
        motion = motion if cycles == 1 else motion.repeat(cycles)
        overloads = overloads_of(carrying, motion)
        if overloads and not anyway:
            raise DataError(
                f"{'; '.join(overloads)}; give a smaller payload or a longer --duration, or see "
                "what happens with --anyway"
            )
        how: dict[str, Any] = {"sensors": Sensors(encoder=encoder), "delay": delay, "step": step}
        how |= {"model": believed, "payload": carried.payload if at_tool else 0.0, "method": method}
        simulation = simulated(machine, motion, acts, **how)
        simulation = replace(simulation, payload=simulation.payload * 0.0 + carried.payload)
    warn(overloads)
    if simulation.stopped:
        note(f"Stopped {simulation.stopped}")
    record = _data(simulation, law_name, cycle, carried)
    person = partial(_tell, simulation, record, carried, out)
    code = _ENDED if simulation.stopped else 0
    return destination.deliver(
        simulation.table(), record, partial(_pictures, simulation), person, code
    )


def _model(machine: Manipulator, name: str, elbows: str | None) -> Manipulator:
    """Return the controller's model of a machine; raise unless coordinates and joints agree."""
    model = load_robot(name, elbows)
    for what, names, other in (
        ("pose is", machine.coordinates, model.coordinates),
        ("joints are", machine.joint_names, model.joint_names),
    ):
        if names != other:
            raise DataError(
                f"--model {name}: its {what} {' '.join(other)}, and of {machine.name} "
                f"{' '.join(names)}; give a model of the same machine"
            )
    return model


def controller_of(name: Name, motion: Motion, period: float, bandwidth: float | None) -> Controller:
    """Return a controller; an adaptive one learns the parameters that the motion excites."""
    from pteron.controllers import Adaptive, ComputedTorque, FeedForwardPD, PDGravity

    kinds: dict[str, Any] = {
        "computed-torque": ComputedTorque,
        "feed-forward": FeedForwardPD,
        "pd": PDGravity,
        "adaptive": partial(Adaptive, motion=motion),
        "adaptive-drives": partial(Adaptive, motion=motion, friction=True),
    }
    controller: Controller = kinds[name](period=period, bandwidth=bandwidth)
    return controller


def _data(simulation: Simulation, controller: str, cycle: str, carried: Carried) -> dict[str, Any]:
    """Return a simulation as JSON data: tracking errors by coordinate, and loads by leg."""
    import numpy as np

    robot, error = simulation.robot, simulation.error
    power = simulation.forces * simulation.joint_rates
    drives = {
        "peak_force": np.abs(simulation.forces).max(axis=0),
        "rms_force": [np.sqrt(np.mean(force**2)) for force in simulation.forces.T],
        "peak_speed": np.abs(simulation.joint_rates).max(axis=0),
        "peak_power": np.abs(power).max(axis=0),
        "at_its_limit": simulation.saturated_share,
    }
    tracking = {
        "largest": np.abs(error).max(axis=0),
        "rms": [np.sqrt(np.mean(deviation**2)) for deviation in error.T],
    }
    return {
        "robot": robot.name,
        "cycle": cycle,
        "controller": controller,
        **asdict(carried),
        "duration": float(simulation.time[-1]),
        "samples": len(simulation.time),
        "step": None if np.isnan(simulation.step) else simulation.step,
        "stopped": simulation.stopped,
        "tracking": _rows({"coordinate": robot.coordinates} | tracking),
        "drives": _rows({"leg": range(1, len(robot.legs) + 1)} | drives),
    }


def _rows(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return columns of equal length as rows."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _pictures(simulation: Simulation) -> dict[str, str]:
    """Return SVG texts of the tracking errors and of the drive forces, by file name."""
    from pteron.plots import forces_figure, svg_file, tracking_figure

    units = ", ".join(dict.fromkeys(leg.joint.force_unit for leg in simulation.robot.legs))
    forces = forces_figure(simulation.time, simulation.forces, ylabel=f"drive force ({units})")
    tracking = tracking_figure(simulation.time, simulation.error, simulation.robot.coordinates)
    return {"tracking.svg": svg_file(tracking), "forces.svg": svg_file(forces)}


def _tell(
    simulation: Simulation, record: dict[str, Any], carried: Carried, out: str | None
) -> None:
    """Print for a person; without --out a pipe gets the table."""
    if is_terminal() or out is not None:
        _show(simulation, record, carried)
    else:
        write(simulation.table().write_csv())


def _micro_text(error: float, unit: str) -> str:
    """Return an error in millionths of its unit, below a thousandth of that as such."""
    return f"{significant(1e6 * error)} u{unit}" if error >= 1e-9 else f"< 0.001 u{unit}"


def _show(simulation: Simulation, record: dict[str, Any], carried: Carried) -> None:
    """Print tables of the tracking errors and of the drives' loads."""
    robot = simulation.robot
    steps = "DOP853" if record["step"] is None else f"steps of {record['step'] * 1e3:.3g} ms"
    errors = (
        (row["coordinate"], *(_micro_text(row[key], unit) for key in ("largest", "rms")))
        for row, unit in zip(record["tracking"], robot.units, strict=True)
    )
    drives = []
    for leg, row in zip(robot.legs, record["drives"], strict=True):
        force, speed = leg.joint.force_unit, f"{leg.joint.unit}/s"
        units = {"peak_force": force, "rms_force": force, "peak_speed": speed, "peak_power": "W"}
        sizes = (f"{significant(row[key])} {unit}" for key, unit in units.items())
        limited = leg.drive and leg.drive.max_force
        share = percent(row["at_its_limit"]) if limited else "unlimited"
        drives.append((str(row["leg"]), *sizes, share))
    word = force_word(robot)
    saturated = f"time at {word} limit"
    names = ("leg", f"peak {word}", f"RMS {word}", "peak speed", "peak power", saturated)
    end = "stopped early" if simulation.stopped else "completed"
    show(
        f"[bold]{plain(robot.name)}[/bold]{plain(str(carried))}, "
        f"{plain(cycle_text(record['cycle']))} {end}: {record['duration']:.4g} s in {steps}, "
        f"controller {plain(record['controller'])}",
        table("tracking error", "largest", "RMS", rows=errors, numbers=("largest", "RMS")),
        table(*names, rows=drives, numbers=names),
    )

"""`simulate`: a machine's motion under a controller, or under given forces, sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, get_args, runtime_checkable

import numpy as np

from pteron.arguments import expect
from pteron.equations.transmissions import DriveKind
from pteron.errors import DataError, shorten
from pteron.kernels import Array, as_array
from pteron.kernels.named_columns import pick_columns
from pteron.kinematics.evaluate import finite_pose, finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion
from pteron.motion.payload import with_payload
from pteron.motion.simulation.loop import ControlLaw, Loads, Timing, run_simulation
from pteron.motion.simulation.plant import Method
from pteron.motion.simulation.sensors import Sensors
from pteron.motion.simulation.simulation import Simulation
from pteron.motion.simulation.stable_steps import allowed_step
from pteron.progress import Progress
from pteron.shapes import JointsLike, PoseLike

STEP = 1e-4
"""Length of the integration's steps, s, where none is given and friction allows it."""

PERIOD = 1e-3
"""Time between two samples, s, where no controller sets it."""

_POSES = 64
"""Poses of a motion at which the longest stable step is computed."""

_MOST = 10_000_000
"""Most samples of a simulation; a longer one is refused."""

_HALVINGS = 12
"""Most times that steps are halved for a stated error."""

_SAFE = 0.5
"""Share of a stated error that a change may be: halving a step of first order leaves an error as
large as the change."""

_STATE = ("start, pose", "start, velocity")
"""Names in messages of the two parts of the start state."""


@runtime_checkable
class Controls(Protocol):
    """A controller: its sampling period, and its law for a model of the machine."""

    @property
    def period(self) -> float:
        """Sampling period of the controller, s."""

    def law(self, model: Manipulator) -> ControlLaw:
        """Return the control law for a machine model."""


def simulate(
    robot: RobotLike,
    motion: Motion | None = None,
    controller: Controls | None = None,
    *,
    start: tuple[PoseLike, PoseLike] | None = None,
    duration: float | None = None,
    forces: JointsLike | Callable[[float], JointsLike] | None = None,
    model: RobotLike | None = None,
    payload: float | Sequence[tuple[float, float]] = 0.0,
    wrench: PoseLike | Callable[[float], PoseLike] | None = None,
    sensors: Sensors | None = None,
    delay: float = 0.0,
    limits: bool = True,
    period: float = PERIOD,
    step: float = STEP,
    method: Method = "rk4",
    tolerance: float = 1e-10,
    error: float | None = None,
    progress: Progress | None = None,
) -> Simulation:
    """Simulate a machine with drives under a controller, under given forces, or free.

    The rigid bodies and the motors' inertia move under the drives' forces and friction. Dry
    friction sticks: a joint at rest does not move until the force on it exceeds its friction (with
    "dop853" friction is smooth at rest, by `rest_speed`, and such a joint creeps). No drive gives
    more than its `max_force`. At each sample the controller receives the reference and the measured
    joints; the forces that it returns are held until the next sample, as in a digital drive. The
    simulation ends, with the reason in `stopped`, where a leg reaches the limit of its reach; and
    under a controller, unless `limits` is false, at a joint limit or a type-II singularity.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion, optional
        What it is to follow; without it a controller holds the pose at the start.
    controller : Controller, optional
        Of `pteron.controllers`, or anything like them.
    start : (pose, velocity), optional
        Where the platform begins, (m,) each; by default on the motion.
    duration : float, optional
        s; by default the motion's.
    forces : array, shape (n,), or callable of the time (s), optional
        Of the drives, where there is no controller; none by default. N, N m at cranks.
    model : Manipulator, name or path, optional
        What the controller takes the machine for; by default what it is, with a payload that does
        not change.
    payload : float or sequence of (time, mass)
        What the tool carries, kg; of a sequence each mass from its time (s) on, zero before.
    wrench : array, shape (m,), or callable of the time (s), optional
        Further load on the platform at P, held from sample to sample: a force in N and, where it
        turns, a moment about k in N m; of a platform that tilts a force and a moment, (6,).
    sensors : Sensors, optional
        The encoders; by default coordinates and rates are exact.
    delay : float
        From a sample to what the drives give for it, s.
    limits : bool
        Whether joints' limits and singularities of type II end a simulation with a controller.
    period : float
        Between two samples where there is no controller, s.
    step : float
        Length of the integration's steps, s; shorter where viscous friction needs it;
        refused where a transmission's stiffness or a current needs a shorter one.
    method : {"rk4", "dop853"}
        Fixed steps of Runge and Kutta's method of fourth order, compiled, of second order across a
        joint's stop or start, and of first where one with dry friction reverses; or SciPy's method
        of Dormand and Prince of eighth order, of which `tolerance` bounds the error of each step.
    tolerance : float
        For "dop853", relative to the state; absolutely a thousandth of it.
    error : float, optional
        Greatest error of the poses that the steps may cause at any sample, m and rad: the steps are
        shortened, from `step` on, until twice in a row no pose changes by more than half of it. For
        "rk4".
    progress : callable, optional
        Takes the share of the samples that is done; with `error` anew for each length of step.

    Returns
    -------
    Simulation

    Raises
    ------
    DataError
        If a number is not sensible, or what is given does not go together.
    UnreachablePose, SingularPose
        If the start is out of reach or singular.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.motion import simulate
    >>> robot = pteron.load("tripteron")
    >>> falling = simulate(robot, start=(np.zeros(3), np.zeros(3)), duration=0.1)
    >>> falling.stopped is None, bool(falling.velocity[-1, 2] < -0.9)
    (True, True)
    """
    robot = as_manipulator(robot)
    if controller is not None:
        _expect_controller(controller, forces)
    if model is not None:
        model = as_manipulator(model)
    if motion is not None and controller is None:
        raise DataError("motion given, but no controller that follows it")
    period = period if controller is None else controller.period
    check_positive(period=period, step=step, tolerance=tolerance)
    check_delay(delay)
    _expect_method(robot, method)
    reference = reference_of(robot, motion, start, duration, period)
    pose, velocity = reference.pose[0], reference.velocity[0]
    if start is not None:
        pose, velocity = _state(robot, start)
    masses = _masses(payload, reference.time)
    machines = {mass: with_payload(robot, mass) for mass in dict.fromkeys(masses.tolist())}
    source: ControlLaw | Array
    if controller is None:
        source = _sample_source(forces, robot, "forces", reference.time)
    else:
        known_machine = model or (machines[masses[0]] if len(machines) == 1 else robot)
        source = controller.law(known_machine)
    sample_poses = np.vstack([pose, reference.pose[:: max(1, len(reference.time) // _POSES)]])
    sensors = sensors or Sensors()
    sensing = sensors.delay + sensors.samples * period
    length = allowed_step(robot, sample_poses, step, usual=step == STEP)
    timing = Timing(delay, method, length, tolerance, sensing)
    loads = Loads(masses, machines, _sample_source(wrench, robot, "wrench", reference.time))

    def run_with(timing: Timing) -> Simulation:
        """Return the simulation with these sampling times, delays and steps."""
        arguments = (pose, velocity), reference, source, loads, sensors, timing
        ends = limits and controller is not None
        return run_simulation(robot, *arguments, limits=ends, progress=progress)

    return run_with(timing) if error is None else _refine_steps(run_with, timing, error, period)


def _refine_steps(
    run_with: Callable[[Timing], Simulation], timing: Timing, error: float, period: float
) -> Simulation:
    """Repeat a simulation with shorter steps until no pose changes by more than `error`.

    The error of a step in which a joint reverses is of first order in its length, and depends on
    when in the step it reverses. So each run has an odd number of steps, more than twice the
    previous number, so that no two runs divide a sample alike, and two successive changes must be
    small enough.
    """
    check_positive(error=error)
    if timing.method != "rk4":
        raise DataError('error: goes with method "rk4"; the steps of "dop853" have `tolerance`')
    coarse, changes = run_with(timing), [np.inf]
    for _ in range(_HALVINGS):
        length = min(timing.step, coarse.step)
        count = round(period / length)
        timing = replace(timing, step=period / (2 * count + 1) if count else length / 2.0)
        fine = run_with(timing)
        common_length = min(len(fine.time), len(coarse.time))
        changes.append(float(np.abs(fine.pose[:common_length] - coarse.pose[:common_length]).max()))
        if max(changes[-2:]) <= _SAFE * error and len(fine.time) == len(coarse.time):
            return fine
        coarse = fine
    raise DataError(
        f"error: {error:g} asked for, but steps of {timing.step:.2g} s still change poses "
        f"by {changes[-1]:.2g}, {min(changes):.2g} at best: encoders that round, or a loop that is "
        "unstable, make much of the smallest difference; ask for less"
    )


def _expect_method(robot: Manipulator, method: Method) -> None:
    """Raise if the integration method is unknown, or unsuited to the machine's drives."""
    expect(method in get_args(Method), "method", repr(method), '"rk4" or "dop853"')
    if method == "dop853" and not DriveKind.from_robot(robot).plain:
        raise DataError(
            f'method: "dop853" given, but the drives of {robot.name} bend, lag or ripple; "rk4" '
            "has them"
        )


def _expect_controller(controller: object, forces: object) -> None:
    """Raise if `controller` is no controller, or forces are given in addition to it."""
    period = getattr(controller, "period", None)
    if isinstance(controller, type) or not isinstance(period, float | int):
        raise DataError(
            f"controller: {shorten(controller)} given, one such as ComputedTorque() expected"
        )
    if forces is not None:
        raise DataError("controller and forces given; give one of them")


def check_delay(delay: float) -> None:
    """Raise if a delay, s, is negative or not finite."""
    expect(_is_number(delay) and delay >= 0.0, "delay", shorten(delay), "0 s or more")


def _is_number(number: object) -> bool:
    """Return whether a value is a finite real number."""
    return isinstance(number, int | float | np.number) and bool(np.isfinite(number))


def check_positive(**positive: float) -> None:
    """Raise if a named number is not positive and finite."""
    for name, number in positive.items():
        expect(_is_number(number) and number > 0.0, name, shorten(number), "a number above 0")


def _state(robot: Manipulator, start: tuple[PoseLike, PoseLike]) -> tuple[Array, Array]:
    """Return the initial pose and velocity as arrays (m,); raise if they are not finite."""
    expect(len(start) == len(_STATE), "start", f"{len(start)} parts", "a pose and a velocity")
    pose, velocity = (finite_pose(robot, v, name) for v, name in zip(start, _STATE, strict=True))
    return pose, velocity


def reference_of(
    robot: Manipulator,
    motion: Motion | None,
    start: tuple[PoseLike, PoseLike] | None,
    duration: float | None,
    period: float,
) -> Motion:
    """Return the reference motion at the samples: the motion argument, or rest at the start."""
    if motion is not None:
        motion.expect_ascending()
    if duration is None:
        if motion is None:
            raise DataError("duration: not given, nor a motion that has one; give it in s")
        duration = motion.duration
    check_positive(duration=duration)
    if duration < period:
        raise DataError(f"duration: {duration:g} s given, at least a sample of {period:g} s")
    if duration > _MOST * period:
        raise DataError(
            f"duration: {duration:g} s given, {duration / period:.3g} samples of {period:g} s; at "
            f"most {_MOST} are served"
        )
    time: Array = period * np.arange(round(duration / period) + 1.0)
    if motion is not None:
        names = ("motion.pose", "motion.velocity", "motion.acceleration")
        parts = zip(motion.at(motion.time[0] + time), names, strict=True)
        return Motion(time, *(finite_rows(robot, part, name) for part, name in parts))
    if start is None:
        raise DataError("start: not given, nor a motion to start on; give a pose and a velocity")
    zeros = np.zeros((len(time), robot.freedom))
    return Motion(time, zeros + _state(robot, start)[0], zeros, zeros)


def _masses(payload: float | Sequence[tuple[float, float]], time: Array) -> Array:
    """Return the payload mass at each sample (T,), kg."""
    array = as_array(payload, "payload", ())
    if array.ndim == 0:
        return np.full(len(time), array)
    pairs = array.ndim == 2 and array.shape[1:] == (2,) and bool(np.isfinite(array[:, 0]).all())
    if not pairs or (np.diff(array[:, 0]) < 0.0).any():
        raise DataError("payload: a mass, or pairs of time and mass in the order of time, expected")
    if not (array[:, 1] >= 0.0).all():
        wrong = array[~(array[:, 1] >= 0.0), 1][0]
        raise DataError(f"payload: {wrong} given, a mass of 0 kg or more expected")
    k = np.searchsorted(array[:, 0], time + 1e-9, side="right")
    masses: Array = np.append(0.0, array[:, 1])[k]
    return masses


def _sample_source(
    source: PoseLike | Callable[[float], PoseLike] | None,
    robot: Manipulator,
    name: str,
    time: Array,
) -> Array:
    """Return forces or a wrench at each time (T, k), from a constant or a function of time."""
    columns = robot.column_names[name]
    size = len(columns)

    def numbers(row: PoseLike, title: str) -> Array:
        """Return a row as an array of finite numbers (k,), or raise with its title."""
        array = as_array(pick_columns(row, columns, title), title, (size,))
        expect(array.ndim == 1, title, f"shape {array.shape}", f"({size},)")
        expect(np.isfinite(array).all(), title, shorten(array.tolist()), "finite numbers")
        return array

    if callable(source):
        return np.array([numbers(source(now), f"{name}({now:g})") for now in time.tolist()])
    constant = np.zeros(size) if source is None else numbers(source, name)
    return np.tile(constant, (len(time), 1))

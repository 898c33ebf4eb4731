"""`Rating`: how a machine of a kind does a job, stage by stage, each the cheaper the earlier."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pteron.design.cycle_places import Places, cycles_of
from pteron.design.drive_options import JointLoads, Option, Options, power
from pteron.design.job import OBJECTIVES, Job
from pteron.design.kinds import Kind, slides
from pteron.design.machine_space import MachineSpace
from pteron.design.quantities import moving_mass
from pteron.design.tool_errors import (
    compliance_with,
    compliances,
    errors_with,
    link_sections,
    unit_errors,
)
from pteron.design.workspace_samples import refine_worst_values, sample_poses
from pteron.design.worst_cases import worst_forces, worst_speeds
from pteron.dynamics import drive_forces
from pteron.errors import ModelError, PteronError
from pteron.indices import Section
from pteron.kernels import Array, numeric
from pteron.kinematics import inverse_kinematics, jacobian, joint_accelerations
from pteron.legs import Drive
from pteron.manipulator import Manipulator

_STROKE = 0.03
"""Share of a slider's travel that is added to its guide at each end."""

_TELESCOPE = 1.7
"""Greatest length of a ram over its least."""

_FLOOR = 1.05
"""Ratio of the floors in a search to those that are proved at last."""

_HEAVY = 1e6
"""kg m^2: an inertia beside which that of a machine is nothing."""

_BY_STAGE = 100.0
"""Cost of a design that fails at the last stage; of one before it is twice as much, and so on."""


@dataclass
class Rating:
    """The figures of a machine and its violated bounds, up to the stage at which it failed.

    Attributes
    ----------
    values : array, shape (V,)
        The numbers of the kind.
    figures : dict
        Quantities by name: objectives, margins, error, deflection.
    misses : dict
        By how much each bound is missed, as a share of it: empty where all is kept.
    shortfalls : dict
        The same in words.
    robot : Manipulator or None
        The machine with its drives, without payload.
    middle : array, shape (m,)
        The pose in the middle of the workspace.
    options : tuple of Option
        The drive of each leg.
    worst : array, shape (C, m)
        Poses from the middle at which measures of singularity are least.
    stage : int
        At which it fell out; 0 where it did not.
    near : float
        How far the next cheaper drives are from serving, from 0 on.
    """

    values: Array
    figures: dict[str, float] = field(default_factory=dict)
    misses: dict[str, float] = field(default_factory=dict)
    shortfalls: dict[str, str] = field(default_factory=dict)
    robot: Manipulator | None = None
    middle: Array = field(default_factory=lambda: np.zeros(0))
    options: tuple[Option, ...] = ()
    worst: Array = field(default_factory=lambda: np.zeros((0, 0)))
    stage: int = 0
    near: float = 1.0

    @property
    def machine(self) -> Manipulator:
        """The machine of the rated design; only defined if the first stage of rating passed."""
        assert self.robot is not None
        return self.robot

    def miss(self, name: str, share: float, words: str) -> None:
        """Record the violation of limit `name` as a share of the limit, with a text."""
        if share > self.misses.get(name, 0.0):
            self.misses[name], self.shortfalls[name] = float(share), words

    def expect_least(self, name: str, figure: float, least: float) -> None:
        """Record a violation if `figure` is below `least`."""
        if not figure >= least:
            share = least - figure if np.isfinite(figure) else 1.0
            self.miss(name, share, f"{name} {figure:.3g}, at least {least:.3g} asked")

    def cost(self, objective: str) -> float:
        """Return the scalar cost of the design in a search: objective, or penalty of violations."""
        if self.misses:
            return _BY_STAGE * (6 - self.stage) + min(sum(self.misses.values()), 0.9 * _BY_STAGE)
        cost = self.figures[objective]
        # A price has steps: along one the design is the better whose next step down is nearer.
        return float(np.log(cost) + 0.01 * min(self.near, 1.0)) if cost > 0.0 else 0.0


class KindEvaluator:
    """A job for one kind of machine.

    Parameters
    ----------
    job : Job
        The job.
    kind : Kind
        The kind.
    options : mapping of str to Options
        Drives, by the unit of the joint.
    """

    def __init__(self, job: Job, kind: Kind, options: Mapping[str, Options]) -> None:
        self.job, self.kind, self.options = job, kind, options
        self.poses = sample_poses(job, kind.robot)
        self.corners = sample_poses(job, kind.robot, 2)
        self.outline = sample_poses(job, kind.robot, 3)
        self.every_cycle = cycles_of(job, kind.robot)
        self.cycles = [cycle.spread_places() for cycle in self.every_cycle]
        # A box holds its cycles; between the poses of a list they go where no pose is.
        states = (c.states[0].reshape(-1, kind.robot.freedom) for c in self.every_cycle)
        self.between = np.vstack([self.poses[:0], *(states if job.workspace.poses else ())])
        self.visited = np.vstack([self.poses, self.between])
        self.half = job.workspace.half
        self.machine_space = MachineSpace(job, kind.robot)

    @cached_property
    def groups(self) -> list[list[int]]:
        """Groups of leg indices that share a drive: legs of the same type."""
        legs = self.kind.robot.legs
        kinds = dict.fromkeys((leg.type, leg.joint.unit) for leg in legs)
        return [[i for i, g in enumerate(legs) if (g.type, g.joint.unit) == k] for k in kinds]

    def rate(self, point: Array) -> Rating:
        """Return the rating of design variables (V,): machine, figures and violations by stage."""
        rating = Rating(np.asarray(point, dtype=float))
        try:
            robot, rating.middle = self.kind.machine(point)
        except ModelError:
            rating.stage = 1
            rating.miss("machine", 1.0, "numbers that no machine has")
            return rating
        rating.robot = robot
        for stage, judge in enumerate(
            (self._judge_reach, self._judge_room, self._choose_drives, self._judge_bounds), start=1
        ):
            judge(rating)
            if rating.misses:
                rating.stage = stage
                return rating
        return rating

    def _judge_reach(self, rating: Rating) -> None:
        """Rate reach, singularity measures and joint limits over the workspace, in `rating`.

        The travel of guides and rams is set from the poses.
        """
        robot, poses, floors = rating.machine, rating.middle + self.visited, self.job.floors
        least = float(np.min(numeric(robot, "squared_type_i")(poses)[0]))
        if least >= 0.0:
            sign = np.sign(np.median(numeric(robot, "type_ii")(poses)[0]))

            def measures(places: Array) -> Array:
                """Return type-I (squared), type-II and passive-joint measures (N, k) at N poses."""
                poses = rating.middle + places
                squares, determinant, room = (
                    numeric(robot, name)(poses)[0]
                    for name in ("squared_type_i", "type_ii", "passive_room")
                )
                signed = sign * np.asarray(determinant)
                if any(leg.couples_vary for leg in robot.legs):  # floors of type II hold for it
                    signed = np.minimum(signed, np.abs(numeric(robot, "constraint")(poses)[0]))
                every = np.column_stack([squares, signed, room])
                return np.asarray(np.nan_to_num(every, nan=1.0))

            lowest, rating.worst = self.worst(robot, measures)
            legs_least, type_ii, room = np.split(lowest, [robot.joint_count, robot.joint_count + 1])
            least = float(legs_least.min())
        rating.figures["type_i"] = float(np.sqrt(max(least, 0.0)))
        if least < 0.0:
            rating.miss("reach", 1.0 - least, "a leg that does not reach the whole workspace")
            return
        rating.figures["type_ii"] = float(type_ii[0])
        rating.expect_least("type-I measure", float(np.sqrt(least)), _FLOOR * floors.type_i)
        rating.expect_least("type-II measure", float(type_ii[0]), _FLOOR * floors.type_ii)
        rating.expect_least("passive joints' margin to their limits", float(room.min()), 0.0)
        joints = inverse_kinematics(robot, poses, on_failure="nan")
        if not np.isfinite(joints).all():
            rating.miss("reach", 1.0, "a leg that does not reach the whole workspace")
            return
        shortest, longest = joints.min(axis=0), joints.max(axis=0)
        if self.job.workspace.tilt is not None:
            # Between the tilts of the samples rams are longer and shorter.
            def ends(places: Array) -> Array:
                """Return joint coordinates and their negatives (N, 2 n); infinite out of reach."""
                at = inverse_kinematics(robot, rating.middle + places, on_failure="nan")
                return np.asarray(np.nan_to_num(np.hstack([at, -at]), nan=np.inf))

            shortest, longest = np.split(self.worst(robot, ends)[0], 2)
            longest = -longest
        legs = []
        for leg, low, high in zip(robot.legs, shortest, longest, strict=True):
            spare = _STROKE * (high - low) + 1e-6
            if leg.joint.unit == "m":
                travel = float(low - spare), float(high + spare)
                if not slides(leg):
                    beyond = travel[1] - _TELESCOPE * travel[0]
                    rating.expect_least("rams' margin to their shortest", -beyond / travel[1], 0.0)
                if slides(leg) or not rating.misses:
                    leg = self.kind.with_travel(leg, travel, rating.values)
            elif leg.limits is not None:
                half = 0.5 * (leg.limits[1] - leg.limits[0])
                margin = min(low - leg.limits[0], leg.limits[1] - high) / half
                rating.expect_least("joints' margin to their limits", float(margin), 0.01)
            legs.append(leg)
        rating.robot = replace(robot, legs=tuple(legs))

    def _judge_room(self, rating: Rating) -> None:
        """Record footprint and height, and violations of keep-out boxes and clearances."""
        figures, misses = self.machine_space.evaluate(
            rating.machine, rating.middle + self.visited, rating.middle
        )
        rating.figures |= figures
        for name, (share, words) in misses.items():
            rating.miss(name, share, words)

    def _choose_drives(self, rating: Rating) -> None:
        """Choose the cheapest drives that suffice for loads, accuracy and stiffness.

        The figures of the rating (masses, energy, errors) are recorded.
        """
        robot = self.add_payload(rating.machine)
        numbers = self.kind.numbers(rating.values)
        try:
            loads, work = self.loads(robot, rating, numbers.get("time"))
            errors = gives = None
            if self.job.accuracy is not None:
                poses = rating.middle + np.vstack([self.poses, rating.worst])
                errors = unit_errors(self.job.accuracy, robot, poses)
            if self.job.stiffness is not None:
                poses = rating.middle + np.vstack([self.corners, rating.worst])
                gives = compliances(robot, poses, self.sections(rating))
        except PteronError:
            rating.miss("loads", 1.0, "a singularity or the edge of its reach on a cycle")
            return
        options: list[Option | None] = [None] * robot.joint_count
        margin, near = self.job.motors.margin, 0.0
        for legs in self.groups:
            all_ = self.options[robot.legs[legs[0]].joint.unit]
            margins = loads.margins(all_, legs)
            shares = {
                "rated torque": margins[0] / margin,
                "peak torque": margins[1] / margin,
                "motor speed": margins[2] / margin,
            }
            if self.job.accuracy is not None and errors is not None:
                of_options = errors_with(self.job.accuracy, errors, *all_.numbers[[0, 5]])
                shares["accuracy"] = self.job.accuracy.most / of_options
            if self.job.stiffness is not None and gives is not None:
                given_way = self.job.stiffness.force * compliance_with(gives, all_.numbers[6])
                shares["stiffness"] = self.job.stiffness.most / given_way
            every = np.array(list(shares.values()))
            least = every.min(axis=0)
            good = np.flatnonzero(least >= 1.0)
            if not len(good):
                best = int(least.argmax())
                for name, share in shares.items():
                    _expect_share(rating, name, float(share[best]), all_.all[best].name)
                return
            first = int(good[0])
            if first:
                near += float(1.0 - min(1.0, least[:first].max()))
            for leg in legs:
                options[leg] = all_.all[first]
        rating.near = near / len(self.groups)
        rating.options = tuple(o for o in options if o is not None)
        pairs = zip(rating.machine.legs, rating.options, strict=True)
        legs_with = tuple(replace(leg, drive=option.drive) for leg, option in pairs)
        rating.robot = replace(rating.machine, legs=legs_with)
        friction = np.array([option.drive.coulomb for option in rating.options])
        rating.figures |= {
            "price": float(sum(o.price for o in rating.options)),
            "rated_power": float(sum(map(power, rating.options))),
            "moving_mass": moving_mass(rating.robot),
            "energy": self._energy([float((w + way @ friction).max()) for w, way in work]),
            "cycle_time": numbers.get("time", 0.0),
        }

    def worst(
        self,
        robot: Manipulator,
        values_of: Callable[[Array], Array],
        samples: int | None = None,
        keep: int = 1,
    ) -> tuple[Array, Array]:
        """Return the minima of values (B, C) over the workspace (C,), and their poses (C, m)."""
        return refine_worst_values(self.job, robot, values_of, samples, keep, self.between)

    def shares(self, time: float | None) -> Array:
        """Return the durations, s, by which a duty cycle weights its cycles.

        The array is empty if no cycle has a share.
        """
        pairs = [(c.share, (c.duration or time or 1.0) + c.dwell) for c in self.cycles if c.share]
        return np.array([share * duration for share, duration in pairs])

    def _energy(self, worst: Sequence[float]) -> float:
        """Return the energy of a cycle, J: mean weighted by the cycles' shares, or the maximum."""
        shares = [cycle.share for cycle in self.cycles]
        if not any(shares):
            return max(worst, default=0.0)
        return float(np.average(worst, weights=shares))

    def _judge_bounds(self, rating: Rating) -> None:
        """Record which figures of the design exceed the upper bounds of the job's `[most]`."""
        for name, most in self.job.most.model_dump(exclude_none=True).items():
            figure, unit = rating.figures[name], f" {OBJECTIVES[name]}".rstrip()
            if not figure <= most:
                words = f"{name.replace('_', ' ')} {figure:.4g}{unit}, at most {most:g}{unit} asked"
                rating.miss(name, figure / most - 1.0 if np.isfinite(figure) else 1.0, words)

    def add_payload(self, robot: Manipulator) -> Manipulator:
        """Return the machine with the job's payload on its platform."""
        return self.job.payload.add_to(robot)

    def sections(self, rating: Rating) -> dict[str, Section]:
        """Return the cross-sections of a rated design's upper and lower links, by link."""
        return link_sections(rating.machine, self.kind.link_stocks(rating.values))

    def loads(
        self, robot: Manipulator, rating: Rating, time: float | None
    ) -> tuple[JointLoads, list[tuple[Array, Array]]]:
        """Return the loads of all cycles at all places; each cycle's (work, joint travel)."""
        n, middle = robot.joint_count, rating.middle
        squares, forces, rises, work = [], [np.zeros((1, n))], [np.zeros((1, n))], []
        speeds = np.zeros(n)
        for cycle in self.cycles:
            duration = cycle.duration or time or 1.0
            states = self.states(cycle, middle, duration)
            f = drive_forces(robot, *states)
            a = joint_accelerations(robot, *states).actuated
            v = np.einsum("bkij,bkj->bki", jacobian(robot, states[0]), states[1])
            dwelling = cycle.dwell * np.stack(
                [f[:, -1] ** 2, *[np.zeros_like(f[:, -1])] * 2], axis=-1
            )
            means = np.trapezoid(np.stack([f * f, f * a, a * a], axis=-1), axis=1)
            means = means * duration / (f.shape[1] - 1)
            squares.append((means + dwelling) / (duration + cycle.dwell))
            step = duration / (f.shape[1] - 1)
            energy = np.trapezoid(np.maximum(f * v, 0.0), axis=1).sum(axis=-1) * step
            ways = np.trapezoid(np.abs(v), axis=1) * step
            work.append((energy, ways))
            forces.append(f.reshape(-1, n))
            rises.append(a.reshape(-1, n))
            speeds = np.maximum(speeds, np.abs(v).max(axis=(0, 1)))
        required = self.job.motion
        everywhere = np.zeros((2, n))
        if required.acceleration or required.speed:
            poses = middle + np.vstack([self.outline, rating.worst])
            legs = tuple(replace(leg, drive=Drive(rotor_inertia=_HEAVY)) for leg in robot.legs)
            heavy, speed = replace(robot, legs=legs), max(required.speed, 1e-6)
            rise = required.acceleration
            everywhere[0] = worst_forces(robot, poses, speed, rise).max(axis=0)
            everywhere[1] = worst_forces(heavy, poses, speed, rise).max(axis=0) / _HEAVY
            speeds = np.maximum(speeds, worst_speeds(robot, poses, speed).max(axis=0))
        loads = JointLoads(
            tuple(squares) or (np.zeros((1, n, 3)),),
            self.shares(time),
            np.concatenate(forces),
            np.concatenate(rises),
            speeds,
            everywhere,
        )
        return loads, work

    def states(self, cycle: Places, middle: Array, duration: float) -> tuple[Array, Array, Array]:
        """Return poses, velocities and accelerations (B, K, m) of a cycle run in `duration` s."""
        pose, velocity, acceleration = cycle.states
        return middle + pose, velocity / duration, acceleration / duration**2


def _expect_share(rating: Rating, name: str, share: float, option: str) -> None:
    """Record a violation if the best drive meets only a `share` below 1 of a requirement."""
    if share < 1.0:
        much = f"{share:.0%}" if share >= 0.01 else "less than 1%"
        words = f"{name} {much} of what is asked, with {option}"
        rating.miss(name, 1.0 / max(share, 1e-3) - 1.0, words)

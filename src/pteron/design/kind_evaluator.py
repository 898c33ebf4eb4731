"""`KindEvaluator`: rates machines of a kind for a job, the cheapest stages first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from pteron.design.cycle_places import Places, cycles_of
from pteron.design.job import OBJECTIVES, Job
from pteron.design.joint_loads import JointLoads
from pteron.design.kinds import Kind, joint_kind, slides, with_joint_parts
from pteron.design.machine_space import TIGHT, MachineSpace, Misses
from pteron.design.parts_room import room_between_parts
from pteron.design.quantities import moving_mass
from pteron.design.rating import Rating
from pteron.design.structure import Demand, Structure, structure_figures
from pteron.design.tool_errors import errors_with, unit_errors
from pteron.design.workspace_samples import refine_worst_values, sample_poses
from pteron.design.worst_cases import worst_forces, worst_speeds
from pteron.dynamics import drive_forces, mass_matrix
from pteron.dynamics.joint_space import moved_inertias
from pteron.equations.drives import drives_of
from pteron.errors import ModelError, PteronError
from pteron.kernels import Array, numeric
from pteron.kinematics import inverse_kinematics, jacobian, joint_accelerations
from pteron.kinematics.sampling import holding_measures
from pteron.legs import Drive
from pteron.manipulator import Manipulator
from pteron.parts.drives import Option, Options
from pteron.parts.joints import JointPart, cheapest_joint

_STROKE = 0.03
"""Share of a slider's travel that is added to its guide at each end."""

_TELESCOPE = 1.7
"""Greatest length of a ram over its least."""

_FLOOR = 1.05
"""Ratio of the floors in a search to those that are proved at last."""

_HEAVY = 1e6
"""kg m^2: an inertia beside which that of a machine is nothing."""

_HEAVIER = 1.25
"""Loads for which joints are chosen over those without the joints' own mass."""

_SAG = 1e-3
"""Permitted sag over the workspace's longest side, where no tolerance is given."""

CycleStates = tuple[Array, Array, Array, float]
"""Forces of the rigid machine, accelerations and speeds of the joints (B, K, n); time step, s."""

_ROOM = 0.01
"""Overlap of parts, m, that costs as much as a bound missed by 100 %."""


class KindEvaluator:
    """A job for one kind of machine.

    Parameters
    ----------
    job : Job
        The job.
    kind : Kind
        The kind.
    options : mapping of str to Options
        Drives, by the joint that they fit: "rad", "slider" or "ram".
    parts : sequence of JointPart
        Joints and rails.
    """

    def __init__(
        self,
        job: Job,
        kind: Kind,
        options: Mapping[str, Options],
        parts: Sequence[JointPart],
    ) -> None:
        self.job, self.kind, self.options, self.parts = job, kind, options, parts
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
            (
                self._judge_reach,
                self._judge_room,
                self._judge_structure,
                self._choose_drives,
                self._judge_bounds,
            ),
            start=1,
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
            names = holding_measures(robot)
            signs = [np.sign(np.median(numeric(robot, name)(poses)[0])) for name in names]

            def measures(places: Array) -> Array:
                """Return type-I (squared), type-II and passive-joint measures (N, k) at N poses."""
                poses = rating.middle + places
                squares, room, *holding = (
                    numeric(robot, name)(poses)[0]
                    for name in ("squared_type_i", "passive_room", *names)
                )
                pairs = zip(signs, holding, strict=True)
                signed = np.minimum.reduce([sign * np.asarray(held) for sign, held in pairs])
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
        self._record(rating, figures, misses)

    @staticmethod
    def _record(rating: Rating, figures: dict[str, float], misses: Misses) -> None:
        """Record figures of the space that a machine takes, and its violated limits."""
        rating.figures |= figures
        for name, (share, words) in misses.items():
            rating.miss(name, share, words)

    def _judge_structure(self, rating: Rating) -> None:
        """Choose joints and rails by their loads; record violated limits of the structure."""
        limits, tubes = self.job.limits, self.kind.tubes(rating.machine, rating.values)
        poses = rating.middle + np.vstack([self.corners, rating.worst])
        demand = self.demand(self.kind.numbers(rating.values).get("time"))
        try:
            light = Structure(self.add_payload(rating.machine), poses, demand, tubes)
            found = [
                [
                    cheapest_joint(self.parts, j.kind, _HEAVIER * j.force, _HEAVIER * j.moment)
                    for j in joints
                ]
                for joints in light.joints
            ]
            lacking = [
                joint
                for joints, chosen in zip(light.joints, found, strict=True)
                for joint, part in zip(joints, chosen, strict=True)
                if part is None
            ]
            if lacking:
                worst = max(lacking, key=lambda joint: float(joint.force.max()))
                words = (
                    f"no {worst.kind} joint for a load of {float(worst.force.max()):.3g} N and "
                    f"{float(worst.moment.max()):.3g} N m"
                )
                rating.miss("joint loads", 1.0, words)
                return
            parts = [[part for part in chosen if part is not None] for chosen in found]
            rating.joints, rating.parts = light.joints, parts
            rating.robot = with_joint_parts(rating.machine, light.joints, parts)
            structure = Structure(self.add_payload(rating.robot), poses, demand, tubes)
        except PteronError:
            rating.miss("loads", 1.0, "a singularity or the edge of its reach")
            return
        rating.structure = structure
        if rating.robot.radii != light.robot.radii:  # rails are wider than was assumed
            self._judge_room(rating)
        for name, (figure, bound, at_least) in structure_figures(
            structure, parts, limits, self.job.links
        ).items():
            rating.expect(name, figure, bound, at_least)

    def demand(self, time: float | None) -> Demand:
        """Return what motions and forces the structure must bear, with the cycles' greatest."""
        count = len(self.kind.robot.platform.lengths)
        speed, acceleration = self.job.motion.speed, self.job.motion.acceleration
        turning = np.zeros(self.kind.robot.freedom - count)
        for cycle in self.cycles:
            duration = cycle.duration or time or 1.0
            _, v, a = cycle.states
            speed = max(speed, np.linalg.norm(v[..., :count], axis=-1).max() / duration)
            most = np.linalg.norm(a[..., :count], axis=-1).max() / duration**2
            acceleration = max(acceleration, most)
            turning = np.maximum(turning, np.abs(a[..., count:]).max(axis=(0, 1)) / duration**2)
        force = 0.0 if self.job.process is None else self.job.process.force
        return Demand(float(speed), float(acceleration), turning, force)

    def cycle_frequency(self, time: float | None) -> float:
        """Return the greatest frequency, Hz, of a cycle, or of a sine with the required motion."""
        rates = [1.0 / ((c.duration or time or 1.0) + c.dwell) for c in self.cycles]
        motion = self.job.motion
        if motion.speed and motion.acceleration:
            rates.append(motion.acceleration / (2.0 * np.pi * motion.speed))
        return max(rates, default=0.0)

    @property
    def sag(self) -> float:
        """The permitted displacement of the tool by weights, m."""
        limits, accuracy = self.job.limits, self.job.accuracy
        if limits.sag is not None:
            return limits.sag
        return accuracy.most if accuracy else _SAG * 2.0 * float(self.job.workspace.half.max())

    def _choose_drives(self, rating: Rating) -> None:
        """Choose the cheapest drives that suffice for loads, accuracy and stiffness.

        The figures of the rating (masses, energy, errors) are recorded.
        """
        robot, structure = self.add_payload(rating.machine), rating.structure
        assert structure is not None  # the stage before has made it
        time = self.kind.numbers(rating.values).get("time")
        try:
            loads, states = self.loads(robot, rating, time)
            errors = None
            if self.job.accuracy is not None:
                poses = rating.middle + np.vstack([self.poses, rating.worst])
                errors = unit_errors(self.job.accuracy, robot, poses)
        except PteronError:
            rating.miss("loads", 1.0, "a singularity or the edge of its reach on a cycle")
            return
        options: list[Option | None] = [None] * robot.joint_count
        near, frequency = 0.0, self.job.limits.frequency * self.cycle_frequency(time)
        for legs in self.groups:
            all_ = self.options[joint_kind(robot.legs[legs[0]])]
            travel = max(_travel(robot.legs[leg]) for leg in legs)
            numbers = all_.numbers(travel)
            shares = self._drive_shares(loads, structure, all_, numbers, legs)
            if self.job.accuracy is not None and errors is not None:
                of_options = errors_with(self.job.accuracy, errors, *numbers[[0, 5]])
                shares["accuracy"] = self.job.accuracy.most / of_options
            least = np.min(list(shares.values()), axis=0)
            good = np.flatnonzero(least >= 1.0)
            # Of drives of one stiffness all are too soft if one is.
            soft, first = 0.0, None
            for k in good:
                if numbers[6, k] <= soft:
                    continue
                stiffness = np.full(robot.joint_count, numbers[6, k])
                found = float(structure.frequency(stiffness).min())
                if found >= frequency:
                    first = int(k)
                    break
                soft = float(numbers[6, k])
                shares["natural frequency"] = np.where(numbers[6] <= soft, found / frequency, 1.0)
            if first is None:
                least = np.min(list(shares.values()), axis=0)
                best = int(least.argmax())
                for name, share in shares.items():
                    _expect_share(rating, name, float(share[best]), all_.all[best].name)
                return
            if first:
                near += float(1.0 - min(1.0, least[:first].max()))
            for leg in legs:
                options[leg] = all_.all[first]
        rating.near = near / len(self.groups)
        rating.options = tuple(o for o in options if o is not None)
        self._record_drives(rating, states, time)

    def _record_drives(
        self, rating: Rating, states: Sequence[CycleStates], time: float | None
    ) -> None:
        """Give the machine its chosen drives; record prices, masses, energy, and the room taken."""
        pairs = zip(rating.machine.legs, rating.options, strict=True)
        legs_with = tuple(replace(leg, drive=o.drive(_travel(leg))) for leg, o in pairs)
        rating.robot = replace(rating.machine, legs=legs_with)
        joint_prices = (
            joint.parts * part.price
            for joints, chosen in zip(rating.joints, rating.parts, strict=True)
            for joint, part in zip(joints, chosen, strict=True)
        )
        rating.figures |= {
            "price": float(sum(o.price for o in rating.options) + sum(joint_prices)),
            "rated_power": float(sum(option.power for option in rating.options)),
            "moving_mass": moving_mass(rating.robot),
            "energy": self._energy(rating.robot, states),
            "cycle_time": time or 0.0,
        }
        spacing = self.kind.pair_spacing(rating.robot)
        parts = rating.joints, rating.parts
        room, where, box = room_between_parts(rating.robot, rating.options, *parts, spacing)
        rating.drives_box = box
        extents = self.machine_space.extents(
            rating.robot, rating.middle + self.visited, rating.middle, box
        )
        self._record(rating, *self.machine_space.judge_extents(extents.min(axis=0), TIGHT))
        if room < 0.0:
            words = f"drives, rails or joints overlap by {-1e3 * room:.3g} mm {where}"
            rating.miss("room for parts", -room / _ROOM, words)

    def _drive_shares(
        self,
        loads: JointLoads,
        structure: Structure,
        all_: Options,
        numbers: Array,
        legs: list[int],
    ) -> dict[str, Array]:
        """Return for each limit what each of O drives has over what it needs, (O,) each."""
        limits = self.job.limits
        rated, peak, speed = loads.margins(numbers, legs)
        ratio, inertia = numbers[0], numbers[1]
        held = float(structure.holding[:, legs].max())
        held_torque = np.array([option.rated_torque for option in all_.all])
        rotor = inertia * ratio**2
        least, most = loads.inertia[:, legs]
        shares = {
            "rated torque": limits.rated * rated,
            "holding torque": limits.rated * held_torque * ratio / max(held, 1e-12),
            "peak torque": peak / self.job.motors.margin,
            "motor speed": speed / self.job.motors.margin,
            "load inertia over the rotor's": limits.inertia[1] * rotor / most.max(),
            "rotor inertia over the load's": least.min() / rotor / limits.inertia[0],
            "screw's buckling load": numbers[7]
            / (limits.buckling * max(float(structure.actuators[:, legs].max()), 1e-12)),
            "sag": self.sag / np.maximum(structure.sags(numbers[6]), 1e-12),
        }
        if self.job.stiffness is not None:
            gives = structure.loads.tool_compliance(numbers[6]).max(axis=1)
            shares["stiffness"] = self.job.stiffness.most / (self.job.stiffness.force * gives)
        return shares

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

    def loads(
        self, robot: Manipulator, rating: Rating, time: float | None
    ) -> tuple[JointLoads, list[CycleStates]]:
        """Return the loads of all cycles at all places, and the joints' motion in each cycle."""
        n, middle = robot.joint_count, rating.middle
        squares, forces, rises, cycles = [], [np.zeros((1, n))], [np.zeros((1, n))], []
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
            cycles.append((f, a, v, duration / (f.shape[1] - 1)))
            forces.append(f.reshape(-1, n))
            rises.append(a.reshape(-1, n))
            speeds = np.maximum(speeds, np.abs(v).max(axis=(0, 1)))
        required = self.job.motion
        everywhere = np.zeros((2, n))
        poses = middle + np.vstack([self.outline, rating.worst])
        if required.acceleration or required.speed:
            legs = tuple(replace(leg, drive=Drive(rotor_inertia=_HEAVY)) for leg in robot.legs)
            heavy, speed = replace(robot, legs=legs), max(required.speed, 1e-6)
            rise = required.acceleration
            everywhere[0] = worst_forces(robot, poses, speed, rise).max(axis=0)
            everywhere[1] = worst_forces(heavy, poses, speed, rise).max(axis=0) / _HEAVY
            speeds = np.maximum(speeds, worst_speeds(robot, poses, speed).max(axis=0))
        inertias = moved_inertias(jacobian(robot, poses), mass_matrix(robot, poses))
        process = 0.0 if rating.structure is None else rating.structure.process.max(axis=0)
        loads = JointLoads(
            tuple(squares) or (np.zeros((1, n, 3)),),
            self.shares(time),
            np.concatenate(forces),
            np.concatenate(rises),
            speeds,
            everywhere,
            np.stack([inertias.min(axis=0), inertias.max(axis=0)]),
            process + np.zeros(n),
        )
        return loads, cycles

    def _energy(self, robot: Manipulator, cycles: Sequence[CycleStates]) -> float:
        """Return the energy that the drives give in a cycle, J, at its worst place, as `size` does.

        Of cycles with shares it is their mean, of others the greatest.
        """
        drives = drives_of(robot)
        worst = []
        for f, a, v, step in cycles:
            friction = drives.coulomb * np.tanh(v / drives.rest_speed)
            given = np.maximum((f + drives.inertia * a + friction) * v, 0.0)
            worst.append(float(np.trapezoid(given, axis=1).sum(axis=-1).max() * step))
        shares = [cycle.share for cycle in self.cycles]
        return float(np.average(worst, weights=shares)) if any(shares) else max(worst, default=0.0)

    def states(self, cycle: Places, middle: Array, duration: float) -> tuple[Array, Array, Array]:
        """Return poses, velocities and accelerations (B, K, m) of a cycle run in `duration` s."""
        pose, velocity, acceleration = cycle.states
        return middle + pose, velocity / duration, acceleration / duration**2


def _travel(leg: Any) -> float:
    """Return the travel of a slider or ram, m; 0 of a crank."""
    return float(leg.limits[1] - leg.limits[0]) if leg.joint.unit == "m" else 0.0


def _expect_share(rating: Rating, name: str, share: float, option: str) -> None:
    """Record a violation if the best drive meets only a `share` below 1 of a requirement."""
    if share < 1.0:
        much = f"{share:.0%}" if share >= 0.01 else "less than 1%"
        words = f"{name} {much} of what is asked, with {option}"
        rating.miss(name, 1.0 / max(share, 1e-3) - 1.0, words)

"""`prove_best_design`: the best design of a kind that can be proved, with its worst margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pteron.design.candidate import Candidate
from pteron.design.cycle_places import Places
from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.kind_search import pareto_ratings
from pteron.design.limit_rows import DENSE, limit_rows
from pteron.design.load_margins import margins_of
from pteron.design.proofs import is_clear, kind_proofs, proof_sentence
from pteron.design.rating import Rating
from pteron.design.structure import Structure
from pteron.design.tool_errors import greatest_errors, joint_errors, tolerances
from pteron.design.workspace_samples import sample_poses
from pteron.errors import PteronError
from pteron.indices import Tolerances
from pteron.kernels import Array
from pteron.manipulator import Manipulator, loads
from pteron.manipulator.saving import text_of
from pteron.motion import Motion, Path, limits_of, size, time_optimal
from pteron.workspace import Proof, clearance, home_pose
from pteron.workspace.examination import examine

_WORST = 8
"""Number of worst sample poses that local refinement starts from."""

_TRIED = 9
"""Number of designs that are proved in turn: ranks 1, 2, 4, 8, ..., as neighbours fail alike."""


def prove_best_design(evaluator: KindEvaluator, ratings: list[Rating]) -> Candidate:
    """Return the best rated design whose workspace is proved; else a candidate with the reasons."""
    objectives = evaluator.job.objectives
    good = sorted((r for r in ratings if not r.misses), key=lambda r: r.cost(objectives[0]))
    counts = len(ratings), len(good)
    if not good:
        nearest = min(ratings, key=lambda rating: rating.cost(objectives[0]))
        return Candidate(evaluator.kind.name, False, tuple(nearest.shortfalls.values()), *counts)
    why, tight = "", None
    for rating in (good[2**k - 1] for k in range(_TRIED) if 2**k <= len(good)):
        proofs, rating.robot = kind_proofs(evaluator, rating)
        bad = next((p for p in proofs if p.counterexample is not None), None)
        why = str(bad) if bad is not None else _cell_violation(evaluator, rating)
        if not why:
            best = pareto_ratings(good, shown_objectives(objectives))
            candidate = _candidate(evaluator, rating, proofs, counts, best)
            why = _exceeded_limit(evaluator, candidate)
            if not why and candidate.least_margin >= evaluator.job.motors.margin:
                return candidate
            # Where no design keeps the whole margin between the search's places, the best serves.
            tight = tight or (None if why else candidate)
    return tight or Candidate(evaluator.kind.name, False, (f"failed its check ({why})",), *counts)


def _cell_violation(evaluator: KindEvaluator, rating: Rating) -> str:
    """Return in words the size or keep-out limit that a design violates between samples, or ''."""
    robot = rating.machine

    def extents(poses: Array) -> Array:
        """Return the machine's extents (K, 6 + boxes), m, at poses (K, m) about the middle."""
        poses = rating.middle + poses
        return evaluator.machine_space.extents(robot, poses, rating.middle, rating.drives_box)

    sizes, misses = evaluator.machine_space.judge_extents(evaluator.worst(robot, extents, DENSE)[0])
    rating.figures |= sizes
    return "".join(words for _, words in list(misses.values())[:1])


def _exceeded_limit(evaluator: KindEvaluator, candidate: Candidate) -> str:
    """Return in words the error, load or clearance limit that a candidate exceeds, or ''."""
    job, figures = evaluator.job, candidate.figures
    bounds = {"error": job.accuracy, "deflection": job.stiffness}
    for name, limit in bounds.items():
        if limit is not None and figures[name] > limit.most:
            return f"{name} of {1e3 * figures[name]:.3g} mm, {1e3 * limit.most:g} mm allowed"
    if figures["clearance"] < job.floors.clearance:
        return (
            f"clearance of {1e3 * figures['clearance']:.3g} mm, "
            f"{1e3 * job.floors.clearance:g} mm required"
        )
    for row in candidate.limits:
        if row.margin < 1.0:
            return f"{row.name} of {row.value:.3g}, {row.limit:.3g} permitted"
    if (most := job.most.energy) is not None and figures["energy"] > most:
        return f"energy of {figures['energy']:.4g} J, {most:g} J permitted"
    rated = figures.get("rated_margin", np.inf)
    if rated * job.limits.rated < 1.0:
        return f"torque over rated torque of {1.0 / rated:.3g}, {job.limits.rated:g} permitted"
    least = candidate.least_margin
    return f"drive margin of {least:.3g} at {candidate.worst}" if least < 1.0 else ""


def shown_objectives(objectives: Sequence[str]) -> list[str]:
    """Return the names of the objectives; a single name is followed by that of a tie-breaker."""
    other = "footprint" if objectives[0] != "footprint" else "height"
    return list(objectives) if len(objectives) > 1 else [objectives[0], other]


def _candidate(
    evaluator: KindEvaluator,
    rating: Rating,
    proofs: list[Proof],
    counts: tuple[int, int],
    best: list[Rating],
) -> Candidate:
    """Return the candidate of a proved design: figures, margins, drives, sizes and proof text."""
    robot = rating.robot = replace(rating.machine, home=tuple(rating.middle.tolist()))
    loaded_robot = evaluator.add_payload(robot)
    figures = dict(rating.figures)
    time = evaluator.kind.numbers(rating.values).get("time")
    assert rating.structure is not None  # a feasible design has one
    process = rating.structure.process.max(axis=0)
    margins = margins_of(evaluator, loaded_robot, rating.middle, time, process)
    figures |= margins.figures
    limits = tuple(limit_rows(evaluator, rating))

    def least(values_of: Callable[[Array], ArrayLike]) -> float:
        """Return the minimum of `values_of(poses)` over the workspace, refined between samples."""

        def column(poses: Array) -> Array:
            """Return the quantity (K, 1) at poses (K, m) about the middle."""
            return np.reshape(values_of(rating.middle + poses), (-1, 1))

        return float(evaluator.worst(robot, column, DENSE, _WORST)[0][0])

    figures["clearance"] = least(lambda poses: clearance(robot, poses).least)
    if (accuracy := evaluator.job.accuracy) is not None:
        errors = _tolerances(evaluator, rating)
        figures["error"] = -least(lambda poses: -greatest_errors(accuracy, robot, poses, errors))
    if (required := evaluator.job.stiffness) is not None:
        figures["deflection"] = required.force / least(_tool_stiffness(evaluator, rating))
    cycle = None if margins.place is None else _cycle_at(rating, *margins.place)
    figures["energy"] = _energy(evaluator, rating, loaded_robot)
    figures |= _cycle_figures(loaded_robot, cycle, margins.place)
    times = _shortest_times(evaluator, loaded_robot, rating, margins.place)
    objectives = shown_objectives(evaluator.job.objectives)
    return Candidate(
        evaluator.kind.name,
        True,
        (),
        *counts,
        proof_sentence(evaluator, proofs),
        _clear_words(evaluator, robot, rating.middle),
        _dimensions(robot),
        {name: figure for name, figure in (figures | times).items() if np.isfinite(figure)},
        tuple(option.name for option in rating.options),
        margins.worst,
        tuple({name: r.figures[name] for name in objectives} for r in best),
        text_of(replace(robot, name=f"{evaluator.kind.name}-chosen")),
        tuple(rating.middle.tolist()),
        limits,
        tuple(check_warnings(text_of(robot))),
        _part_counts(rating),
        {
            key: name
            for key, name in evaluator.kind.link_stocks(rating.values).items()
            if key in evaluator.kind.tubes(robot, rating.values)
        },
        "" if cycle is None else _table_text(robot, cycle),
    )


def _tool_stiffness(evaluator: KindEvaluator, rating: Rating) -> Callable[[Array], Array]:
    """Return the function of poses (K, m) that gives the tool's least stiffness there (K,), N/m."""
    robot = evaluator.add_payload(rating.machine)
    stiffnesses = np.array([option.stiffness for option in rating.options])
    tubes = evaluator.kind.tubes(robot, rating.values)
    still = replace(evaluator.demand(1.0), speed=0.0)

    def tool_stiffness(poses: Array) -> Array:
        """Return the tool's least stiffness (K,), N/m, at poses (K, m)."""
        loads = Structure(robot, poses, still, tubes).loads
        rows = loads.tool_actuators / np.sqrt(stiffnesses)[:, None]
        return np.asarray(1.0 / np.linalg.eigvalsh(loads.tool_links + rows.mT @ rows)[:, -1])

    return tool_stiffness


def _cycle_at(rating: Rating, cycle: Places, k: int) -> Motion:
    """Return a cycle at one of its places."""
    duration = cycle.duration or rating.figures["cycle_time"]
    pose, velocity, acceleration = (part[k] for part in cycle.states)
    time = np.linspace(0.0, duration, cycle.samples)
    return Motion(time, rating.middle + pose, velocity / duration, acceleration / duration**2)


def _energy(evaluator: KindEvaluator, rating: Rating, robot: Manipulator) -> float:
    """Return the energy that the drives give in a cycle at its worst place, J, by `size`.

    Of cycles with shares it is their mean, of others the greatest.
    """
    worst = []
    for cycle in evaluator.cycles:
        places = (_cycle_at(rating, cycle, k) for k in range(len(cycle.turns)))
        given = (size(robot, motion, dwell=cycle.dwell).given_energy.sum() for motion in places)
        worst.append(max(map(float, given)))
    shares = [cycle.share for cycle in evaluator.cycles]
    return float(np.average(worst, weights=shares)) if any(shares) else max(worst, default=0.0)


def _table_text(robot: Manipulator, motion: Motion) -> str:
    """Return a motion as CSV: time, pose and its two derivatives."""
    import polars as pl

    columns = {"t": motion.time}
    parts = (motion.pose, motion.velocity, motion.acceleration)
    for order, part in zip(("", "d", "dd"), parts, strict=True):
        columns |= {f"{order}{c}": x for c, x in zip(robot.coordinates, part.T, strict=True)}
    return pl.DataFrame(columns).write_csv()


def _cycle_figures(
    robot: Manipulator, motion: Motion | None, place: tuple[Places, int] | None
) -> dict[str, float]:
    """Return what `size` says of the drives in a cycle: torques, speed and energies, by name."""
    if motion is None or place is None:
        return {}
    sizing = size(robot, motion, dwell=place[0].dwell)
    rms, peak = sizing.motor_torques
    return {
        "peak_torque": float(peak.max()),
        "rms_torque": float(rms.max()),
        "motor_speed": float(sizing.motor_speeds[1].max()),
        "energy_given": float(sizing.given_energy.sum()),
        "energy_braked": float(sizing.braked_energy.sum()),
    }


def _part_counts(rating: Rating) -> dict[str, int]:
    """Return the names of the joints and rails of a design with their numbers."""
    counts: Counter[str] = Counter()
    for joints, parts in zip(rating.joints, rating.parts, strict=True):
        for joint, part in zip(joints, parts, strict=True):
            counts[part.name] += joint.parts
    return dict(counts)


def check_warnings(text: str) -> list[str]:
    """Return what `pteron check` warns of in a machine's file with this text."""
    robot = loads(text)
    return list(examine(robot, home_pose(robot)).warnings)


def _clear_words(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> str:
    """Return a sentence on the clearance between parts: proved, or evaluated at sample poses."""
    least, samples = evaluator.job.floors.clearance, sample_poses(evaluator.job, robot, DENSE)
    count = len(samples) + len(evaluator.between)
    distance_words = f"come nearer than {1e3 * least:g} mm" if least else "touch"
    if not len(evaluator.between) and is_clear(evaluator, robot, middle):
        return f"proved: no two links, guides or the platform {distance_words}"
    return (
        f"no two links, guides or the platform {distance_words} at {count} sampled poses and near "
        "the worst of them (not proved)"
    )


def _dimensions(robot: Manipulator) -> dict[str, float]:
    """Return the base and platform radii, link lengths and stroke of a machine by name, m."""
    axis, frame = np.array(robot.platform.axis), np.array(robot.platform.frame)
    flat = np.eye(3) - np.outer(axis, axis)
    guides = np.array([leg.guide_point for leg in robot.legs])
    points = np.array([np.array(g.platform_point) @ frame + g.fixed_offset for g in robot.legs])
    sizes = {
        "base radius": float(np.linalg.norm((guides - guides.mean(axis=0)) @ flat, axis=1).max()),
        "platform radius": float(np.linalg.norm(points @ flat, axis=1).max()),
    }
    words = {"upper": "crank", "lower": "rod"}
    for quantity in (q for leg in robot.legs for q in leg.quantities if q.role == "length"):
        word = words.get(quantity.name.split("_")[0], quantity.name)
        sizes[word] = max(sizes.get(word, 0.0), float(quantity.value[0]))
    strokes = [g.limits[1] - g.limits[0] for g in robot.legs if g.limits and g.joint.unit == "m"]
    return sizes | ({"stroke": max(strokes)} if strokes else {})


def _tolerances(evaluator: KindEvaluator, rating: Rating) -> Tolerances:
    """Return the `Tolerances` of a design, with the errors and backlash of its gearboxes."""
    accuracy = evaluator.job.accuracy
    assert accuracy is not None  # who asks has some
    gears = np.array([(o.gearbox.ratio, o.gearbox.backlash) for o in rating.options])
    return tolerances(accuracy, joint_errors(accuracy, *gears.T).tolist())


def _shortest_times(
    evaluator: KindEvaluator, robot: Manipulator, rating: Rating, place: tuple[Places, int] | None
) -> dict[str, float]:
    """Return {"shortest_time": s}: time-optimal duration of the cycle at `place`; {} if none."""
    if place is None:
        return {}
    cycle, k = place
    path = _ShiftedPath(cycle.select_places(np.array([k])), rating.middle)
    # Drives are left what the margin asks for.
    share, drive_limits = evaluator.job.motors.margin, limits_of(robot)
    limits = replace(
        drive_limits, force=drive_limits.force / share, speed=drive_limits.speed / share
    )
    with suppress(PteronError):
        return {"shortest_time": time_optimal(robot, path, limits).duration}
    return {}


class _ShiftedPath(Path):
    """A path from the middle of a workspace at one place."""

    def __init__(self, place: Places, middle: Array) -> None:
        self._place, self._middle, self._path = place, middle, place.path

    @property
    def length(self) -> float:
        """The length of the path, in units of its parameter."""
        return self._path.length

    @property
    def rests(self) -> tuple[float, ...]:
        """The path parameters at which the motion stops."""
        return self._path.rests

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Return poses (N, m) and their first and second derivatives by the path parameter (N,)."""
        pose, first, second = (part[0] for part in self._place.curves(*self._path.at(s)))
        return self._middle + pose, first, second

    def place(self, s: float) -> str:
        """Return the name of the place on the path at a parameter."""
        return self._path.place(s)

"""`judged`: the best design of a kind, proved, with margins at the worst place and direction."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from pteron.design.choosing.kinds import slides
from pteron.design.choosing.rating import Case, Rating
from pteron.design.choosing.samples import Places, sample_poses
from pteron.design.choosing.search import front
from pteron.design.choosing.tool import elasticity, greatest_errors, joint_errors, tolerances
from pteron.design.worst_cases import worst_forces, worst_speeds
from pteron.dynamics import drive_forces
from pteron.errors import PteronError
from pteron.indices import stiffness
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator
from pteron.manipulator.saving import text_of
from pteron.motion import Path, limits_of, time_optimal
from pteron.workspace import Box, Cylinder, Proof, Region, prove

_TRIED = 8
"""Designs of which a proof is tried, the best first."""

_NOTHING = 1e-9
"""Least force, speed or torque by which a limit is divided."""

_DENSE = 7
"""Poses along each side of a box at which errors and stiffness are looked at last."""

_BOXES = 60_000
"""Boxes after which a proof is given up."""

_LONGER = 0.05
"""Share of its travel by which a guide is made longer where a proof meets its end."""


@dataclass(frozen=True)
class Candidate:
    """One kind of machine after the search: its best design, or why there is none.

    Attributes
    ----------
    kind : str
        In the catalog.
    serves : bool
        Whether a design keeps all that is asked.
    why : tuple of str
        Where none does: what the nearest misses, and how far.
    evaluated, kept : int
        Designs that were rated, and those of them that keep all that is asked.
    proved : str
        What is proved of the workspace, in words.
    dimensions : dict
        m, by name.
    figures : dict
        Price, masses, energy, margins, error, deflection and times; SI units.
    drives : tuple of str
        Motor and gearbox of each leg.
    worst : str
        The place and direction at which the drives' margin is least.
    front : tuple of dict
        The objectives of designs that no other of the kind betters in everything.
    robot : str
        The machine's file, with its drives; empty where there is none.
    middle : tuple of float
        The pose in the middle of its workspace.
    """

    kind: str
    serves: bool
    why: tuple[str, ...]
    evaluated: int
    kept: int
    proved: str = ""
    dimensions: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    drives: tuple[str, ...] = ()
    worst: str = ""
    front: tuple[dict[str, float], ...] = ()
    robot: str = ""
    middle: tuple[float, ...] = ()

    def data(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def judged(case: Case, found: list[Rating]) -> Candidate:
    """Return the best design of a search that can be proved, or why there is none."""
    objectives = case.job.objectives
    first, second = shown_objectives(objectives)[:2]
    good = sorted(
        (r for r in found if not r.misses), key=lambda r: (r.figures[first], r.figures[second])
    )
    counts = len(found), len(good)
    if not good:
        nearest = min(found, key=lambda one: one.cost(objectives[0]))
        return Candidate(case.kind.name, False, tuple(nearest.told.values()), *counts)
    why = ""
    for one in good[:_TRIED]:
        proofs = _proofs(case, one)
        bad = next((p for p in proofs if p.counterexample is not None), None)
        why = str(bad)
        if bad is None:
            made = _candidate(case, one, proofs, counts, front(good, shown_objectives(objectives)))
            why = _exceeded(case, made)
            if not why:
                return made
    return Candidate(case.kind.name, False, (f"no proof ({why})",), *counts)


def _exceeded(case: Case, found: Candidate) -> str:
    """Return in words what a design exceeds between the poses of its search; empty for nothing."""
    job, figures = case.job, found.figures
    bounds = {"error": job.accuracy, "deflection": job.stiffness}
    for name, asked in bounds.items():
        if asked is not None and figures[name] > asked.most:
            return f"not so: {name} of {1e3 * figures[name]:.3g} mm, {1e3 * asked.most:g} mm asked"
    names = ("rated_margin", "peak_margin", "speed_margin")
    least = min(figures.get(name, np.inf) for name in names)
    return f"not so: the drives' margin is {least:.3g} at {found.worst}" if least < 1.0 else ""


def shown_objectives(objectives: Sequence[str]) -> list[str]:
    """Return the objectives, of one alone with another that decides between equals."""
    other = "moving_mass" if objectives[0] != "moving_mass" else "footprint"
    return list(objectives) if len(objectives) > 1 else [objectives[0], other]


def _proofs(case: Case, one: Rating) -> list[Proof]:
    """Return proofs of the workspace; guides that it meets the end of are made longer."""
    floors = case.job.floors
    found: list[Proof] = []
    for _ in range(4):
        robot = one.robot
        assert robot is not None  # it keeps all that is asked
        regions = list(_regions(case, robot, one.middle))
        found = [
            prove(robot, region, type_i=floors.type_i, type_ii=floors.type_ii, most=_BOXES)
            for region in regions
        ]
        causes = {c.leg for proof in found if not proof.holds for c in proof.causes}
        ended = {i for i in causes if i and slides(robot.legs[i - 1])}
        if not ended:
            break
        legs = list(robot.legs)
        for i in ended:
            low, high = legs[i - 1].limits or (0.0, 0.0)
            spare = _LONGER * (high - low)
            legs[i - 1] = replace(legs[i - 1], limits=(low - spare, high + spare))
        one.robot = replace(robot, legs=tuple(legs))
    return found


def _regions(case: Case, robot: Manipulator, middle: Array) -> list[Region]:
    """Return the workspace as regions: each pose of a list, a cylinder at each turn."""
    space, count = case.job.workspace, len(robot.platform.lengths)
    if space.poses is not None:
        return [Box(tuple(pose), tuple(pose)) for pose in middle + case.poses]
    if space.radius is not None and space.height is not None:
        turns = np.unique(case.poses[:, count:], axis=0)
        centers = ((*middle[:count], *(middle[count:] + turn)) for turn in turns)
        return [Cylinder(tuple(map(float, c)), space.radius, space.height) for c in centers]
    half = np.abs(case.poses).max(axis=0)
    half[:count] = case.half[:count]
    low, high = middle - half, middle + half
    if space.turn is not None:
        low[-1], high[-1] = middle[-1] + space.turn[0], middle[-1] + space.turn[1]
    return [Box(tuple(low.tolist()), tuple(high.tolist()))]


def _candidate(
    case: Case, one: Rating, proofs: list[Proof], counts: tuple[int, int], best: list[Rating]
) -> Candidate:
    robot = one.robot
    assert robot is not None  # it keeps all that is asked
    carrying = case.loaded(robot)
    figures = dict(one.figures)
    margins, worst, place = _margins(case, carrying, one)
    figures |= margins
    poses = one.middle + sample_poses(case.job, robot, _DENSE)
    if case.job.accuracy is not None:
        figures["error"] = _error(case, robot, one, poses)
    if case.job.stiffness is not None:
        springs = elasticity(case.sections(one), [o.gearbox.stiffness for o in one.options])
        least = stiffness(robot, poses, springs).least.min()
        figures["deflection"] = float(case.job.stiffness.force / least)
    times = _reached(case, carrying, one, place)
    objectives = shown_objectives(case.job.objectives)
    return Candidate(
        case.kind.name,
        True,
        (),
        *counts,
        _proof_words(case, proofs),
        _dimensions(robot),
        {name: value for name, value in (figures | times).items() if np.isfinite(value)},
        tuple(option.name for option in one.options),
        worst,
        tuple({name: r.figures[name] for name in objectives} for r in best),
        text_of(replace(robot, name=f"{case.kind.name}-chosen")),
        tuple(one.middle.tolist()),
    )


def _proof_words(case: Case, proofs: Sequence[Proof]) -> str:
    boxes = sum(proof.boxes for proof in proofs)
    if case.job.workspace.poses is not None:
        return f"every one of {len(proofs)} poses and orientations keeps reach, limits and floors"
    if all(proof.holds for proof in proofs):
        poses = "every pose" if len(proofs) == 1 else f"every position, at {len(proofs)} turns,"
        return f"proved: {poses} keeps reach, limits and floors, by intervals over {boxes} boxes"
    return (
        f"kept at {len(case.poses)} sample poses; intervals over {boxes} boxes do not decide of all"
    )


def _dimensions(robot: Manipulator) -> dict[str, float]:
    """Return the radii and lengths of a machine, m."""
    axis, frame = np.array(robot.platform.axis), np.array(robot.platform.frame)
    flat = np.eye(3) - np.outer(axis, axis)
    guides = np.array([leg.guide_point for leg in robot.legs])
    points = np.array([np.array(g.platform_point) @ frame + g.fixed_offset for g in robot.legs])
    found = {
        "base radius": float(np.linalg.norm((guides - guides.mean(axis=0)) @ flat, axis=1).max()),
        "platform radius": float(np.linalg.norm(points @ flat, axis=1).max()),
    }
    words = {"upper": "crank", "lower": "rod"}
    for quantity in (q for leg in robot.legs for q in leg.quantities if q.role == "length"):
        word = words.get(quantity.name.split("_")[0], quantity.name)
        found[word] = max(found.get(word, 0.0), float(quantity.value[0]))
    strokes = [g.limits[1] - g.limits[0] for g in robot.legs if g.limits and g.joint.unit == "m"]
    return found | ({"stroke": max(strokes)} if strokes else {})


def _margins(
    case: Case, robot: Manipulator, one: Rating
) -> tuple[dict[str, float], str, tuple[Places, int] | None]:
    """Return the drives' least margins with friction and rotors, and where the least of all is.

    `robot` carries the payload, and has its drives.
    """
    drives = [leg.drive for leg in robot.legs]
    most = np.array([d.max_force or np.inf for d in drives if d is not None])
    rated = np.array([d.rated_force or np.inf for d in drives if d is not None])
    fastest = np.array([d.max_speed or np.inf for d in drives if d is not None])
    found = {"rated_margin": np.inf, "peak_margin": np.inf, "speed_margin": np.inf}
    least, worst, place = np.inf, "", None
    time = case.kind.numbers(one.values).get("time", 1.0)
    for cycle in case.cycles:
        duration = cycle.duration or time
        states = case.states(cycle, one.middle, duration)
        forces = drive_forces(robot, *states)
        rates = np.einsum("bkij,bkj->bki", jacobian(robot, states[0]), states[1])
        means = np.trapezoid(forces**2, axis=1) / (forces.shape[1] - 1) * duration
        held = cycle.dwell * forces[:, -1] ** 2
        rms = np.sqrt((means + held) / (duration + cycle.dwell))
        several = {
            "rated_margin": (rated / np.maximum(rms, _NOTHING)).min(axis=-1),
            "peak_margin": (most / np.maximum(np.abs(forces).max(axis=1), _NOTHING)).min(axis=-1),
            "speed_margin": (fastest / np.maximum(np.abs(rates).max(axis=1), _NOTHING)).min(
                axis=-1
            ),
        }
        for name, values in several.items():
            found[name] = min(found[name], float(values.min()))
        every = np.min(list(several.values()), axis=0)
        if every.min() < least:
            k = int(every.argmin())
            least, worst, place = float(every[k]), cycle.words(k), (cycle, k)
    asked = case.job.motion
    if asked.acceleration or asked.speed:
        places = sample_poses(case.job, robot, _DENSE)
        poses, speed = one.middle + places, max(asked.speed, _NOTHING)
        forces = np.maximum(worst_forces(robot, poses, speed, asked.acceleration), _NOTHING)
        rates = np.maximum(worst_speeds(robot, poses, speed), _NOTHING)
        peak, fast = float((most / forces).min()), float((fastest / rates).min())
        found["peak_margin"] = min(found["peak_margin"], peak)
        found["speed_margin"] = min(found["speed_margin"], fast)
        if min(peak, fast) < least:
            at = (most / forces).min(axis=-1) if peak < fast else (fastest / rates).min(axis=-1)
            corner = places[int(at.argmin())][: len(robot.platform.lengths)]
            told = ", ".join(f"{1e3 * x:+.0f}" for x in corner)
            worst = f"the motion in any direction, at ({told}) mm"
    return found, worst, place


def _error(case: Case, robot: Manipulator, one: Rating, poses: Array) -> float:
    """Return the greatest error of the tool, m, as the job counts it."""
    asked = case.job.accuracy
    assert asked is not None  # who asks has some
    gears = np.array([(o.gearbox.ratio, o.gearbox.backlash) for o in one.options])
    given = tolerances(asked, joint_errors(asked, *gears.T).tolist())
    return float(greatest_errors(asked, robot, poses, given).max())


def _reached(
    case: Case, robot: Manipulator, one: Rating, place: tuple[Places, int] | None
) -> dict[str, float]:
    """Return the shortest time of the cycle at its worst place with these drives, s."""
    if place is None:
        return {}
    cycle, k = place
    shift = cycle.shifts[k][: len(robot.platform.lengths)]
    path = _Moved(cycle.path, one.middle, shift, float(cycle.turns[k]))
    # Drives are left what the margin asks for.
    share = case.job.motors.margin
    drives = [leg.drive for leg in robot.legs if leg.drive is not None]
    limits = limits_of(
        robot,
        force=[(d.max_force or np.inf) / share for d in drives],
        speed=[(d.max_speed or np.inf) / share for d in drives],
    )
    with suppress(PteronError):  # TOPP-RA is an extra
        return {"shortest_time": time_optimal(robot, path, limits).duration}
    return {}


class _Moved(Path):
    """A path from the middle of a workspace, at a place and turned about the upright."""

    def __init__(self, path: Path, middle: Array, shift: Array, turn: float) -> None:
        self._path, self._at = path, middle.copy()
        self._at[: len(shift)] += shift
        self._turn = np.eye(len(middle))
        c, s = np.cos(turn), np.sin(turn)
        self._turn[:2, :2] = [[c, s], [-s, c]]

    @property
    def length(self) -> float:
        return self._path.length

    @property
    def rests(self) -> tuple[float, ...]:
        return self._path.rests

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        pose, first, second = self._path.at(s)
        return self._at + pose @ self._turn, first @ self._turn, second @ self._turn

    def place(self, s: float) -> str:
        return self._path.place(s)

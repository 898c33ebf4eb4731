"""Proofs that all poses of a design's workspace, or of its largest cube, can be used.

A search tests points; here interval arithmetic (`pteron.workspace.prove`) covers all poses between
them, under the floors (least measures) of the search. A counterexample is excluded from the cube,
which is sought anew until it is proved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import chain

import numpy as np

from pteron.design.design import Design
from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.rating import Rating
from pteron.design.regions import (
    kind_regions,
    placed_pose,
    sampled_orientations,
    workspace_region,
)
from pteron.design.spec import ROUNDING
from pteron.design.task import Task
from pteron.kernels import Array, sharing_programs
from pteron.manipulator import Manipulator, Radii
from pteron.result import Result
from pteron.workspace import Box, Proof, Region, interference, prove
from pteron.workspace.fit import UNKNOWN, Fit, proved_fit
from pteron.workspace.shape_samples import Samples, fixed_samples
from pteron.workspace.tilts import OrientedRegion

_SHARES = (0.9999, 0.999, 0.995, 0.98, 0.95, 0.9, 0.75, 0.5, 0.25, 0.1)
"""Shares of the cube's edge that are tried in turn: at the whole edge some condition is zero, which
cannot be decided."""

_PLACED = (1.0, 0.9999)
"""Shares of a workspace that floats, at the place that is found for it."""

_MOST, _MOST_ORIENTED = 200_000, 20_000
"""Greatest number of boxes of a proof at one orientation, and over ranges of orientations: beyond
the second, which takes a few seconds, single orientations are proved."""

_BOXES, _BOXES_CLEAR = 60_000, 1_000
"""Boxes after which a proof of reach is given up, and a proof that no two bodies touch, whose
boxes take longer."""

_LONGER = 0.05
"""Share of its travel by which a guide or ram grows where a proof fails at its end."""


@dataclass(frozen=True, eq=False, repr=False)
class ProvedCube(Result):
    """A cube of which every pose keeps reach, limits and floors, at each orientation.

    Attributes
    ----------
    center : array, shape (k,)
        m.
    edge : float
        m.
    found : float
        The edge that the search found before its proof, m: a little more than what is proved, or
        much more where its points missed a hole.
    proofs : tuple of Proof
        One for each orientation.
    side : float
        Sign of the type-II measure in it.
    """

    center: Array
    edge: float
    found: float
    proofs: tuple[Proof, ...]
    side: float

    @property
    def words(self) -> str:
        """The proved statement about the cube, as a sentence."""
        boxes = sum(proof.boxes for proof in self.proofs)
        return (
            f"proved: every position in the cube with edge {1000.0 * self.edge:.1f} mm about "
            f"{place_words(self.center)} is in reach, within limits and the singularity floors "
            f"(interval arithmetic, {boxes} boxes)"
        )


def place_words(center: Array) -> str:
    """Return a place (k,) in m as text in mm: "(0, 0, -812.4) mm"."""
    numbers = ", ".join(f"{round(1000.0 * x, 1) + 0.0:g}" for x in center)
    return f"({numbers}) mm" if len(center) > 1 else f"{numbers} mm"


@dataclass(frozen=True, eq=False, repr=False)
class Proved(Result):
    """A design as far as it is proved.

    Attributes
    ----------
    design : Design
        Its cube is the proved one, and where the workspace is not proved it misses it.
    cube : ProvedCube or None
        The largest cube, where the search seeks one and there is one.
    workspace : tuple of Proof
        Proofs of the required workspace, one for each orientation; none where none is required.
    """

    ROWS = "design"

    design: Design
    cube: ProvedCube | None
    workspace: tuple[Proof, ...]


def prove_design(design: Design) -> Proved:
    """Prove a design's workspace and cube; return the proofs and the design as far as proved."""
    task, cube = design.task, None
    workspace: tuple[Proof, ...] = ()
    if task.seeks_place:
        known, cube = design.cube, proved_cube(design)
        if cube is not None:
            known = Fit(cube.center, cube.edge, cube.side, 0.0)
        elif known.edge > task.shape[1] * _SHARES[0]:
            known = replace(known, edge=0.0, margin=UNKNOWN)
        design = replace(design, known=known)
    if task.floats:
        if cube is not None and cube.edge >= task.shape[1] * _SHARES[0] * (1.0 - ROUNDING):
            workspace = cube.proofs
            design = replace(design, known=replace(design.cube, edge=max(cube.edge, task.shape[1])))
        return Proved(design, None, workspace)
    workspace = workspace_proofs(design)
    least = min((_least(design, proof) for proof in workspace if not proof.holds), default=np.inf)
    return Proved(replace(design, least=least), cube, workspace)


@lru_cache(maxsize=8)
def start_design(task: Task) -> Design:
    """Return the initial machine of the task as a proved design."""
    return prove_design(Design(task, task.robot)).design


def proved_cube(design: Design) -> ProvedCube | None:
    """Return the largest cube of a design that can be proved feasible; None if there is none.

    For a workspace that floats, it is the place found for it, at the required size or, if `scale`
    is a quantity of the search, at the largest size.
    """
    task = design.task
    shape, least = task.shape
    capped = task.floats and "scale" not in task.quantity_names

    def search(failing: Array) -> Fit:
        """Return the largest feasible cube without the positions (F, k).

        If the size is capped, the edge is `least` at most.
        """
        fit = design.cube_without(failing) if len(failing) else design.cube
        if placed:
            fit = design.placed_without(failing, thorough=True)
        if not capped:
            return fit
        fits = fit.edge >= least * (1.0 - ROUNDING)
        return replace(fit, edge=min(fit.edge, least) if fits else 0.0)

    def proofs(fit: Fit) -> tuple[Proof, ...]:
        """Return the proofs that all poses of a fitted cube are feasible."""
        return cube_proofs(design, fit.center, fit.edge)

    shares = _PLACED if capped else _SHARES
    placed = bool(task.place_quantities)
    fitted = proved_fit(search, proofs, shape, shares, design.robot.freedom)
    if fitted is None and placed:
        placed = False
        fitted = proved_fit(search, proofs, shape, shares, design.robot.freedom)
    if fitted is None:
        return None
    fit, proved = fitted
    return ProvedCube(fit.center, fit.edge, design.cube.edge, proved, fit.side)


def cube_proofs(design: Design, center: Array, edge: float) -> tuple[Proof, ...]:
    """Return proofs that a cube is feasible, one an orientation, up to the first that fails.

    If the workspace floats, the proofs are for the workspace at this centre, with `edge` its
    greatest side.
    """
    task = design.task
    share = edge / task.shape[1] if task.floats else 1.0

    def places(pose: Array, _: float) -> Region:
        """Return the cube, or the workspace that floats, at the orientation of a pose (m,)."""
        if not task.floats or task.spec.workspace is None:
            return Box(*(placed_pose(pose, center + side * edge) for side in (-0.5, 0.5)))
        return workspace_region(task.spec.workspace.with_center(center), pose, share)

    proofs: list[Proof] = []
    for pose in task.stated_poses:
        proofs += _range_proofs(design, places, pose, (min(share, 1.0),))
        if not proofs[-1].holds:
            break
    return tuple(proofs)


def workspace_proofs(design: Design) -> tuple[Proof, ...]:
    """Return proofs that the required workspace is feasible, one for each orientation.

    A workspace that touches the boundary of the feasible poses is undecided; the proof is then for
    0.9999 of it, about its middle, if that can be proved. `workspace_share` returns this share.
    """
    required = design.workspace
    if required is None:
        return ()
    places = partial(workspace_region, required)
    poses = design.task.stated_poses
    return tuple(chain(*(_range_proofs(design, places, pose, _PLACED) for pose in poses)))


def _range_proofs(
    design: Design,
    places: Callable[[Array, float], Region],
    pose: Array,
    shares: Sequence[float],
) -> list[Proof]:
    """Return the proof for places at a stated pose (m,) and at all orientations about it.

    `places` takes a pose and a share; shares are tried in turn while a proof is undecided. If it is
    at all of them, the proofs are for places at each sampled orientation, up to the first failure.
    """
    task = design.task
    samples = sampled_orientations(task.spec.workspace, task.robot.platform, pose[None])
    first: list[Proof] = []
    for attempts in (pose[None], samples) if task.has_ranges else (pose[None],):
        for share in shares:
            proofs: list[Proof] = []
            for at in attempts:
                region = places(at, share)
                region = task.oriented_region(region, share) if attempts is not samples else region
                proofs.append(_proof(design, region))
                if not proofs[-1].holds:
                    break
            first = first or proofs
            if proofs[-1].holds is not None:
                return proofs
    return first


def counterexamples(design: Design, center: Array, edge: float) -> Samples:
    """Return the counterexamples of failed proofs, in a cube and in the required workspace."""
    edge = min(edge, design.task.shape[1]) if design.task.floats else _SHARES[0] * edge
    cube = cube_proofs(design, center, edge) if edge > 0.0 else ()
    inside, fixed = (
        np.array([p.counterexample for p in part if p.counterexample is not None])
        for part in (cube, () if design.task.floats else workspace_proofs(design))
    )
    size, lengths = design.robot.freedom, len(center)
    inside, fixed = inside.reshape(-1, size), fixed.reshape(-1, size)
    units = (inside[:, :lengths] - center) / (0.5 * edge or 1.0)
    inside[:, :lengths] = 0.0
    return Samples(inside, units, np.ones(len(inside))).join(fixed_samples(fixed, lengths))


def workspace_share(design: Design, proof: Proof) -> float:
    """Return the share (0 to 1) of the required workspace that a proof covers."""
    required = design.workspace
    assert required is not None  # who asks has one
    if design.task.floats:
        sides = np.ptp(proof.region.box, axis=0)[: len(design.cube.center)]
        return min(1.0, round(float(sides.max()) / design.task.shape[1], 6))
    size = np.ptp(proof.region.box, axis=0)
    full_size = np.ptp(design.region(design.task.stated_poses[0]).box, axis=0)
    varies = (size > 0.0) & (full_size > 0.0)
    return min(1.0, round(float((size[varies] / full_size[varies]).max(initial=0.0)), 6)) or 1.0


def is_sampled(task: Task, proofs: Sequence[Proof]) -> bool:
    """Return whether proofs hold at sampled orientations of the workspace's ranges alone."""
    return task.has_ranges and not all(isinstance(p.region, OrientedRegion) for p in proofs)


def _proof(design: Design, region: Region) -> Proof:
    """Return the proof attempt that a design is feasible in a region, with shared programs."""
    floors = design.task.floors
    most = _MOST_ORIENTED if isinstance(region, OrientedRegion) else _MOST
    with sharing_programs(design.task.robot):
        return prove(design.robot, region, type_i=floors.type_i, type_ii=floors.type_ii, most=most)


def _least(design: Design, proof: Proof) -> float:
    """Return the least condition (below 0) at a failed proof's counterexample."""
    if proof.counterexample is None:
        return UNKNOWN
    rows = design.task.conditions.rows(design.geometry, proof.counterexample, design.side)
    return min(UNKNOWN, float(np.nan_to_num(rows, nan=UNKNOWN).min()))


def kind_proofs(evaluator: KindEvaluator, rating: Rating) -> tuple[list[Proof], Manipulator]:
    """Return proofs of the workspace, and the machine with guides and rams lengthened to fit."""
    robot, floors = rating.machine, evaluator.job.floors
    proofs: list[Proof] = []
    for _ in range(4):
        proofs = [
            prove(robot, region, type_i=floors.type_i, type_ii=floors.type_ii, most=_BOXES)
            for region in kind_regions(evaluator, robot, rating.middle)
        ]
        causes = {c.leg for proof in proofs if not proof.holds for c in proof.causes}
        ended = {i for i in causes if i and robot.legs[i - 1].joint.unit == "m"}
        if not ended:
            break
        legs = list(robot.legs)
        for i in ended:
            low, high = legs[i - 1].limits or (0.0, 0.0)
            spare = _LONGER * (high - low)
            travel = low - spare, high + spare
            legs[i - 1] = evaluator.kind.with_travel(legs[i - 1], travel, rating.values)
        robot = replace(robot, legs=tuple(legs))
    return proofs, robot


def proof_sentence(evaluator: KindEvaluator, proofs: Sequence[Proof]) -> str:
    """Return a sentence: what is proved about the workspace, or that it is only sampled."""
    space, boxes = evaluator.job.workspace, sum(proof.boxes for proof in proofs)
    if not all(proof.holds for proof in proofs):
        return (
            f"met at {len(evaluator.poses)} sampled poses; not proved for all (interval "
            f"arithmetic undecided after {boxes} boxes)"
        )
    if space.poses is not None:
        statement = (
            f"each of {len(proofs)} poses and orientations is in reach, within limits and the "
            "singularity floors"
        )
        between = f"; so are the cycles between them at {len(evaluator.between)} samples"
        return statement + (between if len(evaluator.between) else "")
    noun = "pose" if len(proofs) == 1 else f"position, at {len(proofs)} orientations,"
    statement = (
        f"every {noun} is in reach, within limits and the singularity floors (interval "
        f"arithmetic, {boxes} boxes)"
    )
    return (
        f"proved at the sampled tilts alone: {statement}" if space.tilt else f"proved: {statement}"
    )


def is_clear(evaluator: KindEvaluator, robot: Manipulator, middle: Array) -> bool:
    """Return whether all bodies' clearance is proved in the workspace with the given middle."""
    radii, least = robot.radii or Radii(), evaluator.job.floors.clearance / 2.0
    parts = (radii.guide, radii.upper, radii.lower, radii.platform)
    required = interference(robot, Radii(*(part + least for part in parts)))
    workspace = kind_regions(evaluator, robot, middle)
    most = _BOXES_CLEAR // len(workspace)
    return all(prove(robot, region, given=required, most=most).holds for region in workspace)

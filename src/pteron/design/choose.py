"""`choose_machine`: kinds of machines for one job, each with its best design, side by side."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.atomic import write_text
from pteron.design.best_design import prove_best_design
from pteron.design.candidate import Candidate
from pteron.design.job import Job
from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.kind_search import search_kind
from pteron.design.kinds import Kind, fitting_kinds, joint_kind
from pteron.design.limit_rows import LimitRow
from pteron.errors import DataError, PteronError, warn_unlikely
from pteron.html_table import Overview, frame_overview
from pteron.json_values import json_ready
from pteron.kernels.one_thread import one_thread
from pteron.kernels.program_cache import EQUATIONS, name_of
from pteron.manipulator import load
from pteron.manipulator.saving import text_of
from pteron.motion import read_motors
from pteron.parts.drives import GEARBOXES, MOTORS, Options, read_gearboxes
from pteron.parts.joints import JOINT_PARTS, read_joints
from pteron.processes import WorkerPool
from pteron.progress import Progress, Share
from pteron.renamed import former_attribute
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl

_SEARCH = 0.9
"""Share of a kind's work that is its search."""

_SMALL = 0.05
"""Metres that a workspace counts as where it is smaller, a single pose for one: its machine is of
the size of its parts."""

_SOURCES = (*EQUATIONS, "design", "dynamics", "indices", "kinematics", "motion", "workspace")
"""The packages that a kept kind depends on: of other code it is searched again."""

_HEAVY = 100.0
"""Payload, kg, from which a workspace below 1 m is doubted."""

_TUPLES = ("why", "drives", "front", "middle", "checked")
"""Attributes of a candidate that a file has as lists."""

_KEPT = "kinds"
"""Folder of the kinds that are finished, in that of the results."""


@dataclass(frozen=True, eq=False, repr=False)
class Choice(Result):
    """The kinds of machines searched for a task, each with its best design.

    Attributes
    ----------
    job : Job
        The job.
    candidates : tuple of Candidate
        The best first, by the first objective; those that do not serve last.
    resumed : tuple of str
        Kinds that an earlier run had finished.
    """

    job: Job
    candidates: tuple[Candidate, ...]
    resumed: tuple[str, ...] = ()

    @property
    def best(self) -> Candidate | None:
        """The best candidate of all kinds by the first objective; None if no kind is feasible."""
        return self.candidates[0] if self.candidates and self.candidates[0].serves else None

    def summary(self) -> str:
        """Return a text with a line for each kind of machine: feasible designs or violations."""
        return "\n".join(candidate.summary() for candidate in self.candidates)

    def table(self) -> pl.DataFrame:
        """Return a table with a row for each kind: whether feasible, and figures in SI units."""
        import polars as pl

        rows = [{"kind": c.kind, "serves": c.serves, **c.figures} for c in self.candidates]
        return pl.DataFrame(rows, infer_schema_length=None)

    def _overview(self) -> Overview:
        """Return the overview for notebooks: the best kind, the table and the summary's lines."""
        best = "no kind does what is asked" if self.best is None else f"{self.best.kind} is best"
        return frame_overview("Kinds of machines", best, self.table(), self.summary().splitlines())

    def robots(self) -> dict[str, str]:
        """Return the machines' files as text, by file name: "<kind>.toml", "<kind>-cycle.csv"."""
        serving = [candidate for candidate in self.candidates if candidate.serves]
        machines = {f"{c.kind}.toml": c.robot for c in serving}
        return machines | {f"{c.kind}-cycle.csv": c.cycle for c in serving if c.cycle}

    def assumption_lines(self) -> list[str]:
        """Return the assumptions behind the choice as sentences, one for each list item."""
        motors, links, limits = self.job.motors, self.job.links, self.job.limits
        lists = [motors.list, motors.gearboxes, motors.joints]
        examples = ["Motors, gears, joints and rails are the package's examples, not products."]
        stocks = ", ".join(dict.fromkeys([*links.upper, *links.lower]))
        errors = self.job.accuracy
        left_out = errors is not None and not errors.has_part_errors
        exact = ["The tool's error is that of encoders and gearboxes; links are taken as exact."]
        return [
            *([] if all(lists) else examples),
            "A price is the sum of those of motors, gearboxes, joints and carriages in the lists, "
            "in their currency: without tubes, frame, control and assembly.",
            f"Drives have {motors.margin:g} times the peak torque and speed that the task needs; "
            f"at rest and as root mean square of a cycle they give at most {limits.rated:g} of "
            f"their rated torque. Dry friction is {100.0 * motors.friction:.0f} % of the rated "
            "torque.",
            f"Links are cut from {stocks}; the platform is half of an aluminium disc "
            f"{1e3 * links.plate:g} mm thick; the bracket on a carriage has {links.carriage:g} kg. "
            "Joints are point masses at the ends of links. Base, frame and joints are rigid.",
            f"The rods of a pair are {links.pair:g} platform radii apart; a ram is at most 1.7 "
            "times as long as at its shortest; for collisions a pair of rods counts as one; ball "
            "joints have no limits.",
            "Stress, compression and joint loads are bounded from above over all directions of "
            "the greatest acceleration and speed of the cycles and of [motion].",
            "The shortest cycle is the one at its worst place with this margin of peak torque and "
            "speed; repeated without pauses, it may exceed the rated torque.",
            *(exact if left_out else []),
        ]

    data = former_attribute("data", "as_dict")

    def as_dict(self) -> dict[str, Any]:
        """Return objectives, candidates and job as a dictionary of plain data, SI units."""
        contents = {
            "objectives": list(self.job.objectives),
            "kinds": [candidate.as_dict() for candidate in self.candidates],
            "job": self.job.model_dump(mode="json", exclude_none=True),
        }
        return dict(json_ready(contents))


def choose_machine(
    job: Job,
    *,
    folder: str | Path | None = None,
    workers: int = 1,
    progress: Progress | None = None,
    begun: Callable[[Sequence[str], Sequence[str]], None] | None = None,
    finished: Callable[[Candidate], None] | None = None,
) -> Choice:
    """Search all kinds of machines for one that does a job, with its dimensions and drives.

    Each kind is a machine of the catalog whose size, proportions, links and place under the
    workspace vary. A feasible design keeps its reach, singularity thresholds and joint limits over
    the workspace, fits in the permitted space, and has drives for all cycles at every place and in
    every direction. The best feasible design is proved by interval arithmetic.

    Parameters
    ----------
    job : Job
        What the machine must do; see `read_job`.
    folder : str or Path, optional
        Folder of finished kinds; the same call goes on where it was ended.
    workers : int
        Processes that do the work.
    progress : callable, optional
        Takes the share that is done, a `Share` whose step is the kind.
    begun : callable, optional
        Takes the kinds that are searched, and those that an earlier run had finished.
    finished : callable, optional
        Takes each kind that is finished.

    Returns
    -------
    Choice

    Raises
    ------
    DataError
        If no kind can do the motion, a cycle does not fit into the workspace, a list of motors
        cannot be read, or a price is asked for of motors that have none.
    """
    evaluators = evaluators_of(job)
    store = _CandidateStore(None if folder is None else Path(folder) / _KEPT, job, evaluators)
    candidates = {name: known for name in evaluators if (known := store.find(name)) is not None}
    resumed = tuple(candidates)
    shares = {name: float(name in candidates) for name in evaluators}

    def tell(name: str, share: float) -> None:
        """Report the progress of a kind (0 to 1) as a share of the search of all kinds."""
        shares[name] = share if name in candidates else _SEARCH * share
        if progress is not None:
            progress(Share(sum(shares.values()) / len(shares), name))

    remaining = {
        name: evaluator for name, evaluator in evaluators.items() if name not in candidates
    }
    if begun is not None:
        begun(tuple(remaining), resumed)
    if progress is not None and remaining:  # what was done before is not this run's
        progress(Share(sum(shares.values()) / len(shares), next(iter(remaining))))
    for name, candidate in _search_kinds(remaining, workers, tell):
        candidates[name] = candidate
        store.keep(candidate)
        tell(name, 1.0)
        if finished is not None:
            finished(candidate)
    objective = job.objectives[0]
    order = sorted(
        candidates.values(), key=lambda v: (not v.serves, v.figures.get(objective, np.inf), v.kind)
    )
    return Choice(job, tuple(order), resumed)


def evaluators_of(job: Job) -> dict[str, KindEvaluator]:
    """Return an evaluator of the job for each kind of machine that can do the motion, by name."""
    space = job.workspace
    names = fitting_kinds(job.kinds, job.lengths, space.turn, space.tilts)
    lists = job.motors
    motors = read_motors(job.file(lists.list or str(MOTORS)))
    gearboxes = read_gearboxes(job.file(lists.gearboxes or str(GEARBOXES)))
    parts = read_joints(job.file(lists.joints or str(JOINT_PARTS)))
    options = {
        joint: Options.combine(motors, gearboxes, joint, lists.friction)
        for joint in ("rad", "slider", "ram")
    }
    unpriced = [o.name for some in options.values() for o in some.all if not np.isfinite(o.price)]
    if unpriced and ("price" in job.objectives or job.most.price is not None):
        raise DataError(
            f"price: asked for, but {unpriced[0]} has none; add a column price, or ask for "
            '"rated_power"'
        )
    names = [name for name in names if _has_drives(name, options, job)]
    _expect_price(names, options, job)
    needed = 2.0 * float(job.workspace.half.max())
    if job.payload.mass > _HEAVY and needed < 1.0:
        warn_unlikely(
            f"payload of {job.payload.mass:g} kg for a workspace of {1e3 * needed:g} mm: is it in "
            "grams?"
        )
    tool = job.payload.tool
    kinds = (
        Kind(name, max(needed, _SMALL), job.links, tool, job.free, job.gravity) for name in names
    )
    evaluators = {kind.name: KindEvaluator(job, kind, options, parts) for kind in kinds}
    for evaluator in evaluators.values():
        try:
            evaluator.add_payload(evaluator.kind.robot)
        except PteronError as error:
            raise DataError(f"payload: {error}") from None
    return evaluators


def _has_drives(name: str, options: Mapping[str, Options], job: Job) -> bool:
    """Return whether gearboxes exist for all joints of a kind; raise if the job names the kind."""
    joints = {joint_kind(leg) for leg in load(name).legs}
    lacking = [joint for joint in sorted(joints) if not options[joint].all]
    if lacking and job.kinds is not None:
        raise DataError(
            f'{job.motors.gearboxes}: no gearbox with joint = "{lacking[0]}", as {name} needs'
        )
    return not lacking


def _expect_price(names: Sequence[str], options: Mapping[str, Options], job: Job) -> None:
    """Raise if the cheapest drives of every kind cost more than the job allows in all."""
    if (most := job.most.price) is None:
        return
    least = {
        name: sum(options[joint_kind(leg)].all[0].price for leg in load(name).legs)
        for name in names
    }
    cheapest = min(least, key=least.__getitem__)
    if least[cheapest] > most:
        raise DataError(
            f"most.price: {most:g} given, but the cheapest drives of {cheapest} alone cost "
            f"{least[cheapest]:g}, and those of all other kinds more"
        )


def _candidate(evaluator: KindEvaluator, progress: Progress) -> Candidate:
    """Search a kind of machine with one BLAS thread; return its best provable design."""
    search = evaluator.job.search
    with one_thread():
        return prove_best_design(
            evaluator, search_kind(evaluator, search.evaluations, search.seed, progress)
        )


def _search_kinds(
    evaluators: Mapping[str, KindEvaluator], workers: int, tell: Callable[[str, float], None]
) -> Iterator[tuple[str, Candidate]]:
    """Search kinds in `workers` processes; yield (kind, candidate) as each search ends."""
    if workers < 2 or len(evaluators) < 2:
        for name, evaluator in evaluators.items():
            yield name, _candidate(evaluator, partial(tell, name))
        return
    names = list(evaluators)
    with WorkerPool(workers) as pool:
        for k, message in pool.messages(_candidate, list(evaluators.values())):
            if isinstance(message, Candidate):
                yield names[k], message
            else:
                tell(names[k], message)


class _CandidateStore:
    """Finished kinds in a folder, each with a digest of all that it depends on."""

    def __init__(
        self, folder: Path | None, job: Job, evaluators: Mapping[str, KindEvaluator]
    ) -> None:
        self._folder, self._job, self._cases = folder, job, evaluators

    def _digest(self, name: str) -> str:
        """Return the digest of all that a kind's result depends on: job, drives, machine, code."""
        job = self._job.model_dump(mode="json", exclude={"kinds"})
        options = {unit: repr(some.all) for unit, some in self._cases[name].options.items()}
        text = json.dumps(
            [name, job, options, text_of(self._cases[name].kind.robot)], sort_keys=True
        )
        return str(name_of("kind", text, sources=_SOURCES))

    def find(self, name: str) -> Candidate | None:
        """Return the stored candidate of a kind from an earlier run; None if absent or outdated."""
        if self._folder is None or not (file := self._folder / f"{name}.json").is_file():
            return None
        try:
            record = json.loads(file.read_text(encoding="utf-8"))
            if record.pop("digest", None) != self._digest(name):
                return None
            lists = {key: tuple(record[key]) for key in _TUPLES}
            lists["limits"] = tuple(LimitRow(**row) for row in record["limits"])
            return Candidate(**record | lists)
        except (ValueError, TypeError, KeyError):
            return None

    def keep(self, candidate: Candidate) -> None:
        """Write the candidate of a searched kind to the store's folder as a JSON file."""
        if self._folder is not None:
            record = json_ready(candidate.as_dict() | {"digest": self._digest(candidate.kind)})
            self._folder.mkdir(parents=True, exist_ok=True)
            write_text(self._folder / f"{candidate.kind}.json", json.dumps(record, indent=1) + "\n")

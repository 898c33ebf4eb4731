"""Fault isolation: the faults that a fit's residuals show, by name, with size and effect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pteron.identification.drawn_values import DrawnValues
from pteron.identification.errors import LogError
from pteron.identification.estimators import Estimate
from pteron.identification.faults.columns import DELAY, Family, FaultColumns
from pteron.identification.faults.cycle import ReferenceCycle
from pteron.identification.faults.cycle_errors import expected_errors
from pteron.identification.faults.fault import IN_WORDS, ORDER, FaultName, IsolatedFault
from pteron.identification.faults.hidden import hidden_faults
from pteron.identification.faults.log_faults import LogFault
from pteron.identification.faults.play import PlayRecord, backlash_signature
from pteron.identification.faults.search import FoundFault, search_faults
from pteron.identification.faults.searched_parts import SearchedPart, choose_parts, observe_parts
from pteron.identification.felt_forces import felt_part
from pteron.identification.model import Model
from pteron.identification.observation import Observations, motion_mask
from pteron.identification.plausibility import Factor, factor_of_forces, known_values
from pteron.identification.recordings import Recording
from pteron.identification.signals import Preprocessing, samples
from pteron.identification.signals.preprocessing import LATEST
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.tolerances import ROOT_OF_ROUNDING

_ROWS, _MORE = 20_000, 100_000
"""Number of rows of all logs that are searched, those in which the joints move most; and the number
where these have too little motion."""

_ROUNDS = 6
"""Greatest number of times that a delay is corrected and sought again."""

_OF_FACTOR = (
    "All forces of the bodies are {factor:.2g} times those of the drawing, as if the gain of all "
    "torques or the gear ratio were wrong by that factor: check gains, rated torque and gear "
    "ratio, or the drawing's masses."
)
"""Sentence on forces that have a factor in common beside those of the drawing."""

_NAMED = 0.05
"""Percent of a cycle's forces from which a fault is named: statistics see smaller ones where a log
has no noise, and the sampling itself makes them."""


@dataclass(frozen=True, eq=False, repr=False)
class FaultIsolation(Result):
    """The faults that a fit's residuals show.

    Attributes
    ----------
    tried : tuple of str
        The faults that were tried; none where the logs are too short for that.
    faults : tuple of IsolatedFault
        The faults that show and change a reference cycle by 0.05 % or more, the clearest first.
    uncertain : array, shape (n,)
        Error of the forces in a pick-and-place cycle, or in another motion of the logs' range where
        it is larger, that the values' covariance allows, percent of the forces' standard deviation;
        NaN where no cycle fits into the machine's workspace.
    spoiled : array, shape (n,)
        Error that all faults together make in the same motions, percent.
    why_not : str
        The reason why no fault was tried; empty where some were.
    hidden : tuple of str
        Faults that these logs cannot show: by the rank of their equations "gain", a common factor
        of all forces, "clock", at another rate, "scale", of one force; "ratio", "zero", "geometry",
        "elasticity", "load" and "passive", where a usual one changes the forces of another motion
        by more than is trusted before it is told; and "play", where no drive's load changes
        direction often enough.
    late : bool
        Whether forces are late for positions, or early; in a log without noise this changes values,
        even if too little to be named.
    log : tuple of LogFault
        Faults of the logs as such.
    factor : float
        Forces of the bodies over those of the drawing, where all have that factor in common.
    small : tuple of (str, float)
        Faults that show but are too small to be named among `faults`: the name, and the largest
        error that the fault makes in the forces of a reference cycle, percent.
    """

    ROWS = "faults"

    tried: tuple[FaultName, ...]
    faults: tuple[IsolatedFault, ...]
    uncertain: Array
    spoiled: Array
    why_not: str = ""
    hidden: tuple[FaultName, ...] = ()
    late: bool = False
    log: tuple[LogFault, ...] = ()
    factor: float = 1.0
    small: tuple[tuple[FaultName, float], ...] = ()

    suspicions = former_attribute("suspicions", "faults")

    @property
    def causes(self) -> tuple[str, ...]:
        """A sentence for each fault, in the order of repair: log, scale, machine."""
        distorted = any(fault.distorts for fault in self.log)
        of_file = [] if self.factor == 1.0 else [_OF_FACTOR.format(factor=self.factor)]
        ranked = sorted(self.faults, key=lambda fault: ORDER.index(fault.fault))
        # What comes first may look like what comes later: only the first gets a remedy.
        machine = [
            fault.message if k == 0 and not distorted else fault.text_without_remedy
            for k, fault in enumerate(ranked)
        ]
        return (*(fault.message for fault in self.log), *of_file, *machine)

    @property
    def small_faults_text(self) -> str:
        """A clause on the faults that show but are too small to matter, or that none shows."""
        if not self.small:
            return "No fault shows in the residuals"
        names = ", ".join(IN_WORDS[name] for name, _ in self.small)
        most = max(percent for _, percent in self.small)
        effect = "less than 0.01" if most < 0.01 else f"up to {most:.2g}"
        threshold = f"below the threshold of {_NAMED:g} %" if most < _NAMED else "a negligible size"
        return (
            f"No fault that matters shows in the residuals: {names} changes the forces of a cycle "
            f"by {effect} % ({threshold})"
        )

    @property
    def tested(self) -> tuple[str, ...]:
        """The faults that were tried, in words."""
        return tuple(IN_WORDS[name] for name in self.tried)

    @property
    def expected_error(self) -> Array:
        """Expected error of the forces of the reference cycle, in percent (n,)."""
        return np.asarray(np.hypot(self.uncertain, self.spoiled))

    @property
    def matters(self) -> bool:
        """Whether a fault shows that lowers the grade."""
        return any(fault.matters for fault in self.faults)

    @property
    def understates(self) -> bool:
        """Whether a fault shows that the stated errors of the values do not include."""
        return any(fault.understates for fault in self.faults)

    def as_dict(self) -> dict[str, Any]:
        """Return the isolation as plain data."""
        shares = {"uncertain": self.uncertain, "spoiled": self.spoiled, "off": self.expected_error}
        return json_fields(
            tried=self.tried, why_not=self.why_not, cannot_be_told=self.hidden, faults=self.faults
        ) | {
            "log": [fault.as_dict() for fault in self.log],
            "cycle_percent": {
                name: None if np.isnan(percentages).any() else percentages.tolist()
                for name, percentages in shares.items()
            },
        }

    off = former_attribute("off", "expected_error")


def isolate_faults(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
    rotors: Mapping[str, float] | None = None,
    *,
    drawn: DrawnValues | None = None,
) -> FaultIsolation:
    """Return the faults of logs and machine that a fit's residuals show.

    Each fault adds columns to the regressor (`families_of`). Those whose sizes the data tell from
    zero join the fit one after the other, the clearest first. The errors that they make are
    computed on a pick-and-place cycle as fast as the logs' motion, and on states of another motion
    of their range.

    Parameters
    ----------
    model, estimate : Model, Estimate
        The fit.
    recordings : sequence of Recording
        The fitted recordings; 20 000 rows in all are searched, with and without payload.
    preprocessing : sequence of Preprocessing
        Preprocessing of each.
    rotors : mapping of str to float, optional
        Inertia that rotors are known to add at the joints, by the name of the value, SI units.
    drawn : DrawnValues, optional
        Values that the motion does not show, as drawn; they take part in each fit.
    """
    known, why_not = known_values(model, recordings, rotors or {}), ""
    for rows in (_ROWS, _MORE):
        try:
            parts = choose_parts(model, estimate, recordings, preprocessing, rows)
            return _isolate_in_parts(parts, model, estimate, known, drawn)
        except LogError as error:
            why_not = str(error)
        if sum(recording.rows for recording in recordings) <= rows:
            break
    nothing = np.full(model.robot.joint_count, np.nan)
    return FaultIsolation((), (), nothing, nothing, why_not)


def _isolate_in_parts(
    parts: list[SearchedPart],
    model: Model,
    estimate: Estimate,
    known: Mapping[str, float],
    drawn: DrawnValues | None,
) -> FaultIsolation:
    """Return the faults that the residuals of a fit to parts of a log show."""
    columns = parts[0].model
    noise = np.mean([part.preprocessing.force_noise for part in parts], axis=0)

    def observe(some: Sequence[SearchedPart]) -> Observations:
        """Return the observations of parts, with rows for values known from the drawing."""
        rows = observe_parts(some)
        return rows if drawn is None else drawn.append_drawn_values(rows, estimate.noise)

    observations = observe(parts)
    plain, found_faults = _search_with_delay(parts, observations, observe, estimate, noise)
    states = [s for part in parts for s in part.states]
    other = ReferenceCycle.from_range(model.robot, states)
    uncertain, spoiled, each = expected_errors(
        columns, states, other, estimate, plain, found_faults
    )
    step = 1.0 / max(part.preprocessing.rate for part in parts)
    faults, small = _named_faults(columns, plain, found_faults, each, step)

    # Play, which no column has
    play, tested = _isolate_play(parts, estimate.values, step)
    if play is not None and not (play.cycle < _NAMED).all():
        faults.insert(0, play)
        spoiled = np.hypot(spoiled, play.cycle)

    # The scale of all forces, which the residuals cannot show
    factor = factor_of_forces(model, found_faults[-1].fit if found_faults else plain, known)
    gain = None if factor is None else _isolate_gain(factor, tuple(known), faults, len(noise))
    left_open = hidden_faults(columns, observations, noise, other)
    if gain is not None:
        if "clock" in left_open:
            # Weight tells the bodies' mass: a slow clock lets their inertia take from the rotors'.
            gain = replace(gain, as_well=("clock",))
        faults.insert(0, gain)
        spoiled = np.hypot(spoiled, gain.cycle)
    names: dict[FaultName, None] = dict.fromkeys(family.name for family in columns.families)
    further: dict[FaultName, bool] = {"play": tested, "gain": factor is not None}
    tried = (*names, *(name for name, was_tried in further.items() if was_tried))
    if factor is None or not factor.is_detectable:
        left_open.insert(0, "gain")
    if not tested:
        left_open.append("play")
    return FaultIsolation(
        tried,
        tuple(faults),
        uncertain,
        spoiled,
        hidden=tuple(name for name in left_open if name not in {fault.fault for fault in faults}),
        late=any(fault.family is DELAY for fault in found_faults),
        small=small,
    )


def _search_with_delay(
    parts: list[SearchedPart],
    observations: Observations,
    observe: Callable[[Sequence[SearchedPart]], Observations],
    estimate: Estimate,
    noise: Array,
) -> tuple[Estimate, list[FoundFault]]:
    """Return the fit without faults, and the faults that its residuals show together."""
    columns = parts[0].model
    largest = max(float(np.abs(part.log.forces).max()) for part in parts)
    exact = np.abs(estimate.residuals).max() < ROOT_OF_ROUNDING * largest
    plain, found_faults = search_faults(columns, observations, () if exact else None, noise)
    if any(fault.family is DELAY for fault in found_faults):
        # Columns hold for small delays: other faults are sought after a long one is corrected.
        late, shifted = _isolate_delay(parts, observe)
        others = tuple(family for family in columns.families if family is not DELAY)
        fit, found_faults = _search_families(others, shifted, observe)
        if late is not None:
            found_faults.insert(0, replace(late, fit=fit))
    return plain, found_faults


def _named_faults(
    columns: FaultColumns,
    plain: Estimate,
    found_faults: Sequence[FoundFault],
    each: Sequence[Array],
    step: float,
) -> tuple[list[IsolatedFault], tuple[tuple[FaultName, float], ...]]:
    """Return the faults that change a cycle's forces by enough to be named, and the smaller ones.

    Of these the name and the largest change, percent.
    """
    p = len(columns.model.names)
    fits = [plain, *(fault.fit for fault in found_faults)]
    shifts = [
        float(np.abs((b.values[:p] - a.values[:p]) / b.deviations[:p]).max())
        for a, b in pairwise(fits)
    ]
    faults: list[IsolatedFault] = []
    small: list[tuple[FaultName, float]] = []
    for fault, shift, spoils in zip(found_faults, shifts, each, strict=True):
        family = fault.family
        negligible = np.abs(fault.sizes).max() <= family.tolerance.negligible
        if not (spoils < _NAMED).all() and not negligible:
            seen = (fault.sizes, fault.deviations, fault.chance, shift, spoils)
            speeds = None if family.speed is None else family.speed * columns.usual
            labels = tuple(family.sizes(columns.model))
            faults.append(IsolatedFault(family.name, labels, *seen, speeds, step, fault.as_well))
        else:
            small.append((family.name, float(np.max(spoils))))
    return faults, tuple(small)


def _isolate_gain(
    factor: Factor, known: tuple[str, ...], faults: Sequence[IsolatedFault], count: int
) -> IsolatedFault | None:
    """Return the fault of a common factor of all forces; None if the factor may be 1."""
    # A slow clock makes all inertia too small, that of known rotors too.
    slow = [1.0 + float(fault.sizes[0]) for fault in faults if fault.fault == "clock"]
    if not (factor.wrong and all(factor.times(s).wrong for s in slow)):
        return None
    off = factor.value - 1.0
    wrong = np.full(count, 100.0 * abs(1.0 - 1.0 / factor.value))
    size, error = np.array([off]), np.array([factor.deviation])
    return IsolatedFault(
        "gain", known, size, error, factor.chance, abs(off) / factor.deviation, wrong
    )


def _isolate_play(
    parts: Sequence[SearchedPart], beta: Array, step: float
) -> tuple[IsolatedFault | None, bool]:
    """Return the backlash of drives as a fault, or None, and whether enough load reversals occur.

    Play shows as large residuals where loads change direction.
    """
    records, band = [], max(part.preprocessing.band for part in parts)
    for part in parts:
        model, how = part.model.model, part.preprocessing
        carried = np.isin(model.kinds, ("base", "payload"))
        for block in samples(model.robot, part.log, how):
            matrix, measured = (
                felt_part(model.robot, block.states.pose, part)
                for part in (model.matrix(block.states), block.forces)
            )
            moving = motion_mask(block.states.joint_rates, how.slow, how.turning_rows) > 0.0
            residual = measured - matrix @ beta
            load = matrix @ np.where(carried, beta, 0.0)
            records.append(PlayRecord(block.states.time, load, residual, moving))
    signature = backlash_signature(records, band)
    tested = bool(signature.tested.any())
    if np.isnan(signature.times).all():
        return None, tested
    named = np.flatnonzero(~np.isnan(signature.times)).tolist()
    labels = tuple(parts[0].model.model.robot.force_names[joint] for joint in named)
    # The knocks of a cycle are taken to be as strong as those of the logs.
    forces = np.concatenate([part.log.forces for part in parts])
    cycle = 100.0 * np.sqrt(signature.power) / forces.std(axis=0)
    unknown = np.full(len(named), np.nan)
    fault = IsolatedFault(
        "play", labels, signature.times[named], unknown, signature.chance, 0.0, cycle, step=step
    )
    return fault, tested


def delay_of(
    model: Model,
    estimate: Estimate,
    recordings: Sequence[Recording],
    preprocessing: Sequence[Preprocessing],
) -> float:
    """Return the delay, s, of recordings' forces that fits best, less the assumed delay."""
    parts = choose_parts(model, estimate, recordings, preprocessing, _ROWS)
    _, shifted = _isolate_delay(parts, observe_parts)
    return shifted[0].preprocessing.delay - parts[0].preprocessing.delay


def _search_families(
    families: tuple[Family, ...],
    parts: Sequence[SearchedPart],
    observe: Callable[[Sequence[SearchedPart]], Observations],
) -> tuple[Estimate, list[FoundFault]]:
    """Return the fit of parts without faults, and the faults of some families that they show."""
    some = [replace(part, model=replace(part.model, families=families)) for part in parts]
    noise = np.mean([part.preprocessing.force_noise for part in parts], axis=0)
    return search_faults(some[0].model, observe(some), noise=noise)


def _isolate_delay(
    parts: Sequence[SearchedPart], observe: Callable[[Sequence[SearchedPart]], Observations]
) -> tuple[FoundFault | None, list[SearchedPart]]:
    """Return the forces' delay as a fault, None if insignificant, and parts corrected for it."""
    late, shifted = None, list(parts)
    for _ in range(_ROUNDS):
        _, found_faults = _search_families((DELAY,), shifted, observe)
        if not found_faults:
            break
        first, late = late or found_faults[0], found_faults[0]
        delay = shifted[0].preprocessing.delay + float(late.sizes[0])
        delay = min(max(delay, -LATEST), LATEST)
        shifted = [replace(p, preprocessing=replace(p.preprocessing, delay=delay)) for p in shifted]
    if late is not None:
        total_delay = np.array([shifted[0].preprocessing.delay - parts[0].preprocessing.delay])
        late = replace(late, sizes=total_delay, chance=first.chance)
    return late, shifted

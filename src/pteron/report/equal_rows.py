"""Rows of a report's tables: equal legs merged, vectors by component, strokes of joints."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from markupsafe import Markup

from pteron.report.contents import Report
from pteron.report.typeset import format_fixed
from pteron.short_numbers import runs_text

_Row = TypeVar("_Row", bound=Hashable)
"""The type of a row without its leg."""

_LEG_NUMBER = re.compile(r"(?<=[a-z])\d+(?=</sub>)")
"""The number of a leg in the index of a parameter, in HTML."""


class Stroke(NamedTuple):
    """Where a joint stands between its limits, each as a percentage of its range.

    `home` is a place, the others have a beginning and a width.
    """

    home: str
    motion: tuple[str, str]
    workspace: tuple[str, str]


@dataclass(frozen=True)
class MergedSum:
    """Base parameters that differ by the leg alone: numbers from 1, expression, value and unit."""

    numbers: tuple[int, ...]
    expression: Markup
    value: str
    unit: str


def merge_legs(rows: Iterable[tuple[_Row, int | None]]) -> dict[_Row, list[int]]:
    """Return the legs, from 1, of each distinct row, from pairs of a row and its leg, from 0."""
    legs: dict[_Row, list[int]] = {}
    for row, leg in rows:
        legs.setdefault(row, []).extend([] if leg is None else [leg + 1])
    return legs


def merge_sums(
    expressions: Sequence[str], values: Sequence[str], units: Sequence[str]
) -> list[MergedSum]:
    """Return base parameters in HTML, those merged that differ by the number of one leg alone."""
    merged: dict[tuple[str, str, str], list[tuple[int, str]]] = {}
    rows = zip(expressions, values, units, strict=True)
    for k, (line, amount, unit) in enumerate(rows, start=1):
        legs = set(_LEG_NUMBER.findall(line))
        general = _LEG_NUMBER.sub("<i>i</i>", line) if len(legs) == 1 else line
        leg = legs.pop() if len(legs) == 1 else ""
        merged.setdefault((general, amount, unit), []).append((k, leg))
    sums = []
    for (general, amount, unit), members in merged.items():
        (first, leg), *others = members
        line = expressions[first - 1]
        if others and leg:
            legs_text = runs_text(sorted(int(leg) for _, leg in members))
            line = f"{general}, <i>i</i> = {legs_text}"
        sums.append(MergedSum(tuple(k for k, _ in members), Markup(line), amount, unit))
    return sums


def by_component(rows: Iterable[tuple[str, list[str]]]) -> list[tuple[str, list[str]]]:
    """Return rows of texts, vectors that differ between legs as a row for each component."""
    split: list[tuple[str, list[str]]] = []
    for name, texts in rows:
        vectors = [text.strip("()").split(", ") for text in texts]
        is_vector = any(len(vector) == 3 for vector in vectors)
        if not is_vector or len(set(texts)) == 1:
            split.append((name, texts))
            continue
        filled = [vector if len(vector) == 3 else vector * 3 for vector in vectors]
        for axis, components in zip("xyz", zip(*filled, strict=True), strict=True):
            split.append((f"{name} {axis}", list(components)))
    return split


def strokes(report: Report) -> list[Stroke | None]:
    """Return where each joint stands between its limits; None for a joint without limits."""
    ranges = report.joints, report.workspace_joints
    rows: list[Stroke | None] = []
    for i, leg in enumerate(report.robot.legs):
        if leg.limits is None:
            rows.append(None)
            continue
        low, high = leg.limits

        def share(coordinate: float, low: float = low, high: float = high) -> float:
            """Return a coordinate's place between the limits, %."""
            return min(max(100.0 * (coordinate - low) / (high - low), 0.0), 100.0)

        spans = []
        for span in ranges:
            start, end = share(float(span.least[i])), share(float(span.greatest[i]))
            spans.append((_percent(start), _percent(end - start)))
        home = _percent(share(float(report.shown.still.coordinates[i])))
        rows.append(Stroke(home, spans[0], spans[1]))
    return rows


def _percent(share: float) -> str:
    """Return a percentage as CSS has it."""
    return f"{format_fixed(share, 1)}%"

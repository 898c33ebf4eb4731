"""Combinations of unknowns that a calibration's measurements do not show, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pteron.calibration.guess import Guess, UnknownBlock
from pteron.equations.variations import AXIAL
from pteron.reduction.numerical import independent

Array = NDArray[np.float64]

_PART = 0.02
"""Least coefficient of a combination that is named, as a share of the greatest one."""

_NAMED = 6
"""Greatest number of values named of a combination, and of combinations without a name of their
own."""

_WHOLE = 0.9995
"""Coefficient, over the greatest one, that is printed as 1."""

_INSIDE = 1e-5
"""Greatest distance of a unit combination from the space of unseen ones that counts as zero."""


def unseen_combinations(
    start: Guess, blocks: Sequence[UnknownBlock], axes: Array, tolerances: Array
) -> tuple[str, ...]:
    """Return the combinations that the rows of `axes` span, as texts.

    Known combinations, such as a motion of the whole machine, come first, with their number; then
    a basis of the rest.

    Parameters
    ----------
    start : Guess
        The machine.
    blocks : sequence of Block
        The unknowns.
    axes : array, shape (u, p)
        An orthonormal basis of the unseen combinations, in units of the tolerances.
    tolerances : array, shape (p,)
        The tolerances of the p unknowns, SI units.
    """
    lines: dict[str, list[str]] = {}
    remaining = axes
    for text, whose, vector in _named_combinations(start, blocks):
        scaled = vector / tolerances
        size = np.linalg.norm(scaled)
        if not len(remaining) or not size > 0.0:
            continue
        scaled = scaled / size
        if np.linalg.norm(scaled - axes.T @ (axes @ scaled)) > _INSIDE:
            continue
        # The rest of the space is orthogonal to the named combinations.
        projection = remaining @ scaled
        if np.linalg.norm(projection) < _INSIDE:
            continue
        _, _, right_vectors = np.linalg.svd(projection[None])
        remaining = right_vectors[1:] @ remaining
        lines.setdefault(text, []).append(whose)
    sentences = []
    for text, all_of in lines.items():
        owners = list(dict.fromkeys(filter(None, all_of)))
        of = f": {', '.join(owners)}" if owners else ""
        sentences.append(f"{text}{of} ({len(all_of)} combination{'s' * (len(all_of) > 1)})")
    names = [unknown.name for block in blocks for unknown in block.unknowns]
    others = [combination_text(row * tolerances, names) for row in _sparsify_rows(remaining)]
    excess = len(others) - _NAMED
    if excess > 1:
        others[_NAMED:] = [f"and {excess} more combinations of many values"]
    return (*sentences, *others)


def combination_text(vector: Array, names: Sequence[str]) -> str:
    """Return a combination as text: its greatest terms, scaled so that the first is 1."""
    parts = vector / vector[np.abs(vector).argmax()]
    order = np.argsort(-np.abs(parts), kind="stable")
    named = [k for k in order if abs(parts[k]) >= _PART]
    text = ""
    for k in named[:_NAMED]:
        # The greatest part is 1, and comes first without a sign.
        sign = "" if not text else " - " if parts[k] < 0.0 else " + "
        size = "" if abs(parts[k]) > _WHOLE else f"{abs(parts[k]):.2g} "
        text += f"{sign}{size}{names[k]}"
    excess = len(named) - _NAMED
    return text + (f" and {excess} more" if excess > 0 else "")


def _named_combinations(
    start: Guess, blocks: Sequence[UnknownBlock]
) -> Iterator[tuple[str, str, Array]]:
    """Yield the combinations that have a name: its text, its owner, and the vector (p,)."""
    robot = start.robot
    names = [unknown.name for block in blocks for unknown in block.unknowns]
    place = {name: k for k, name in enumerate(names)}

    def vector(**parts: float) -> Array:
        """Return a combination (p,) of unknowns by their shares; 0 for all others."""
        combination = np.zeros(len(names))
        for name, share in parts.items():
            if share:
                combination[place[name]] = share
        return combination

    for name, k in place.items():
        yield "no effect on the measurements", name, np.eye(len(names))[k]
    frame = np.array(robot.platform.frame)
    for i, leg in enumerate(robot.legs, start=1):
        base, platform = f"legs[{i}].guide_point", f"legs[{i}].platform_point"
        if not all(f"{key}.{a}" in place for key in (base, platform) for a in "xyz"):
            continue
        for axis in range(3):
            parts = {f"{base}.{'xyz'[axis]}": 1.0}
            parts |= {
                f"{platform}.{a}": float(v) for a, v in zip("xyz", frame[:, axis], strict=True)
            }
            yield (
                "only the difference of guide_point and platform_point has an effect",
                f"leg {i}",
                vector(**parts),
            )
        zero = f"zeros[{i}]"
        if leg.joint.unit == "m" and leg.joint_axis is not None and zero in place:
            parts = {f"{base}.{a}": -v for a, v in zip("xyz", leg.joint_axis, strict=True)}
            yield (
                "a joint's zero and a shift of its guide point along the slider are the same",
                f"leg {i}",
                vector(**parts, **{zero: 1.0}),
            )
    for letter in "xyz":
        parts = {f"legs[{i + 1}].platform_point.{letter}": 1.0 for i in range(len(robot.legs))}
        parts |= {
            n: 1.0 for n in place if n.endswith(f".{letter}") and n.startswith(("tool.", "marks."))
        }
        if all(name in place for name in parts):
            text = "only the tool's position relative to the platform points has an effect"
            yield text, "", vector(**parts)
    for block in blocks:
        if block.kind == "frame":
            yield from _rigid_motions(start, blocks, names)
    text = "the scale of the whole machine, which a measured length determines"
    yield text, "", _uniform_growth(start, blocks)


def _rigid_motions(
    start: Guess, blocks: Sequence[UnknownBlock], names: Sequence[str]
) -> Iterator[tuple[str, str, Array]]:
    """Yield motions of the whole machine against an instrument whose frame is not known."""
    text = "position and orientation of the machine's own frame in the base"
    for turn, axis in ((turn, axis) for turn in (False, True) for axis in range(3)):
        direction = np.eye(3)[axis]
        combination = np.zeros(len(names))
        for block in blocks:
            part = combination[block.where]
            if block.kind == "geometry":
                for k, change in enumerate(block.changes):
                    if change.group in AXIAL:
                        continue
                    if change.key in ("guide_point", "center"):
                        owners = (*start.robot.legs, start.robot.platform)
                        point = getattr(owners[change.leg], change.key)
                        moved = np.cross(direction, point) if turn else direction
                        part[k] = moved[change.axis or 0]
                    elif change.group == "directions" and turn and not change.is_arc:
                        part[k] = np.array(start.robot.platform.frame)[change.axis or 0][axis]
            elif block.kind == "frame":
                moved = np.cross(direction, start.shift) if turn else direction
                part[:3] = moved
                part[3:] = direction if turn else 0.0
        yield text, "", combination


def _uniform_growth(start: Guess, blocks: Sequence[UnknownBlock]) -> Array:
    """Return the vector (p,) of a uniform scaling of all lengths."""
    legs = start.robot.legs
    lengths = [
        unknown.unit == "m" or (block.kind == "scales" and legs[block.legs[k]].joint.unit == "m")
        for block in blocks
        for k, unknown in enumerate(block.unknowns)
    ]
    return np.where(lengths, np.concatenate([block.values(start) for block in blocks]), 0.0)


def _sparsify_rows(rows: Array) -> Array:
    """Return sparse rows of the same span, by elimination."""
    order = np.argsort(-np.abs(rows).max(axis=0, initial=0.0), kind="stable").tolist()
    taken = independent(rows, order, len(rows), least=1e-6)[0]
    work = np.asarray(np.linalg.solve(rows[:, taken], rows), dtype=float)
    work[np.abs(work) < 1e-6 * np.abs(work).max(axis=1, initial=1e-300, keepdims=True)] = 0.0
    return work

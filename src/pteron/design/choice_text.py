"""A candidate in words and rounded numbers, as the table on the screen and the page have it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pteron.design.candidate import MARGINS, Candidate
from pteron.design.choose import Choice
from pteron.design.job import Job

_FIGURES = {
    "price": ("price (as in lists)", 1.0),
    "cycle_time": ("cycle (s)", 1.0),
    "shortest_time": ("shortest (s)", 1.0),
    "error": ("error (mm)", 1e3),
    "deflection": ("gives way (mm)", 1e3),
    "clearance": ("clear (mm)", 1e3),
    "moving_mass": ("mass (kg)", 1.0),
    "energy": ("energy (J)", 1.0),
}
"""Figures of a candidate that are shown: their headings and factors."""


def cells(candidate: Candidate) -> dict[str, str]:
    """Return a row's numbers by their headings, rounded; of a machine that serves."""
    row = {"margin": _ratio(candidate.least_margin)}
    for name, (heading, factor) in _FIGURES.items():
        if (figure := candidate.figures.get(name)) is not None and (name != "cycle_time" or figure):
            row[heading] = f"{factor * figure:.0f}" if figure > 1e3 else f"{factor * figure:.3g}"
    return row


def drives(candidate: Candidate) -> str:
    """Return motors and gearboxes in a line."""
    return ", ".join(f"{count} x {name}" for name, count in Counter(candidate.drives).items())


def dimensions(candidate: Candidate) -> str:
    """Return the dimensions of a machine in a line, mm."""
    lengths = ", ".join(
        f"{name} {1e3 * length:.0f}" for name, length in candidate.dimensions.items()
    )
    extents = (f"{1e3 * candidate.figures[name]:.0f}" for name in ("width", "depth", "height"))
    return f"{lengths}; it moves within {' x '.join(extents)}"


def margins(candidate: Candidate) -> str:
    """Return the drives' margins and the place of the least, in a line."""
    names = {f"{name}_margin": word for name, word in MARGINS.items()}
    known = {
        word: candidate.figures[name] for name, word in names.items() if name in candidate.figures
    }
    ratios = ", ".join(f"{word} {_ratio(margin)}" for word, margin in known.items())
    return f"{ratios}; least at {candidate.worst}" if candidate.worst else ratios


def _ratio(margin: float) -> str:
    """Return a margin with three significant digits."""
    return f"{margin:.{2 if margin < 10.0 else 1 if margin < 100.0 else 0}f}"


def requirement_lines(job: Job) -> list[str]:
    """Return the requirements of a task, a line each."""
    space, lines = job.workspace, []
    lines.append(space.words)
    if space.turn is not None:
        lines.append(f"turn from {space.turn[0]:g} to {space.turn[1]:g} rad")
    if space.tilt is not None:
        lines.append(f"tilt of {space.tilt:g} rad to every side")
    if space.directions is not None:
        lines.append(f"{len(space.directions)} directions of the platform")
    if any(job.payload.tool):
        lines.append(f"tool at {' x '.join(f'{1e3 * x:g}' for x in job.payload.tool)} mm from P")
    if job.payload.mass:
        lines.append(f"payload {job.payload.mass:g} kg")
    for k, cycle in enumerate(job.cycles, start=1):
        time = "as fast as can be" if cycle.duration is None else f"in {cycle.duration:g} s"
        where = ", anywhere in the workspace" if cycle.anywhere else ""
        share = "" if cycle.share is None else f", {cycle.share:g} in a duty cycle"
        lines.append(f"{cycle.name or f'cycle {k}'} {time}{where}{share}")
    if job.motion.acceleration:
        lines.append(
            f"{job.motion.acceleration:g} m/s^2 at up to {job.motion.speed:g} m/s in any direction"
        )
    if job.accuracy is not None:
        lines.append(f"tool within {1e3 * job.accuracy.most:g} mm ({job.accuracy.counted})")
    if job.stiffness is not None:
        limit = f"{1e3 * job.stiffness.most:g} mm"
        lines.append(f"gives way {limit} at most under {job.stiffness.force:g} N")
    if job.cell.footprint is not None:
        lines.append(f"footprint {' x '.join(f'{x:g}' for x in job.cell.footprint)} m")
    lines += [f"height {job.cell.height:g} m"] if job.cell.height is not None else []
    if job.cell.low is not None and job.cell.high is not None:
        lines.append(f"cell {_box(job.cell.low, job.cell.high)} m")
    lines += [f"kept out of {_box(box.low, box.high)} m" for box in job.keep_out]
    floors = {
        "type_i": "type-I measure",
        "type_ii": "type-II measure",
        "clearance": "clearance (m)",
    }
    for name in sorted(job.floors.model_fields_set):
        lines.append(f"{floors[name]} at least {getattr(job.floors, name):g}")
    bounds = job.most.model_dump(exclude_none=True)
    lines += [f"{name.replace('_', ' ')} at most {bound:g}" for name, bound in bounds.items()]
    return [*lines, f"least {' and '.join(name.replace('_', ' ') for name in job.objectives)}"]


def _box(low: Sequence[float], high: Sequence[float]) -> str:
    return " x ".join(f"{a:g}..{b:g}" for a, b in zip(low, high, strict=True))


def assumption_lines(choice: Choice) -> list[str]:
    """Return the assumptions behind a choice, a line each."""
    motors, links = choice.job.motors, choice.job.links
    examples = [] if motors.list else ["The motors are the package's examples, not products."]
    stocks = ", ".join(dict.fromkeys([*links.upper, *links.lower]))
    errors = choice.job.accuracy
    left_out = errors is not None and not errors.has_part_errors
    exact = ["The tool's error is that of encoders and gearboxes: links count as exact."]
    return [
        *examples,
        "A price is the sum of those in the lists of motors and gearboxes, in their currency.",
        f"Drives are chosen for {motors.margin:g} times what is asked, with dry friction of "
        f"{motors.friction:.0%} of their rated torque; the least margins are told as they are "
        "between the places of the search, too.",
        f"Links are cut from {stocks}; the platform is half of an aluminium disc "
        f"{1e3 * links.plate:g} mm thick; a carriage has {links.carriage:g} kg.",
        f"Guides are {2e3 * links.guide:g} mm wide, cylinders of rams as cranks; a ram is "
        "at most 1.7 times its least length; where links may meet, a pair of rods counts as one; "
        "ball joints have no cones.",
        "The shortest time is that of the cycle at its worst place with this margin of peak torque "
        "and speed; again and again the rated torque may not allow it.",
        *(exact if left_out else []),
    ]

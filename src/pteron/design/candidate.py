"""`Candidate`: one kind of machine after the search, with its figures in numbers and in words."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pteron.design.limit_rows import LimitRow
from pteron.renamed import former_attribute
from pteron.result import Result

MARGINS = {"rated": "rated torque", "peak": "peak torque", "speed": "speed"}
"""The margins of drives, in words."""

_FIGURES = {
    "price": ("price (as in lists)", 1.0),
    "cycle_time": ("cycle (s)", 1.0),
    "shortest_time": ("shortest cycle (s)", 1.0),
    "error": ("tool error (mm)", 1e3),
    "deflection": ("deflection (mm)", 1e3),
    "clearance": ("clearance (mm)", 1e3),
    "moving_mass": ("moving mass (kg)", 1.0),
    "energy": ("energy per cycle (J)", 1.0),
}
"""Figures of a candidate that are shown: their headings and factors."""


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(Result):
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
    clear : str
        Whether it is proved, or sampled, that no two bodies touch.
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
    limits : tuple of LimitRow
        What an engineer limits in every machine.
    checked : tuple of str
        What `pteron check` warns of.
    parts : dict
        Numbers of joints and rails, by name.
    stocks : dict
        What the links are cut from, by their key: upper (cranks) and lower (rods).
    cycle : str
        The cycle at its worst place, a CSV file as `pteron size --cycle` takes it.
    """

    kind: str
    serves: bool
    why: tuple[str, ...]
    evaluated: int
    kept: int
    proved: str = ""
    clear: str = ""
    dimensions: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    drives: tuple[str, ...] = ()
    worst: str = ""
    front: tuple[dict[str, float], ...] = ()
    robot: str = ""
    middle: tuple[float, ...] = ()
    limits: tuple[LimitRow, ...] = ()
    checked: tuple[str, ...] = ()
    parts: dict[str, int] = field(default_factory=dict)
    stocks: dict[str, str] = field(default_factory=dict)
    cycle: str = ""

    def __repr__(self) -> str:
        """Return the kind of machine and the count of feasible designs in one line."""
        return f"<Candidate of {self.kind!r}: {self.count_text}>"

    @property
    def count_text(self) -> str:
        """Number of feasible and of evaluated designs, as text: "3 of 200 designs meet ..."."""
        return f"{self.kept} of {self.evaluated} designs meet all requirements"

    @property
    def verdict(self) -> str:
        """The count of feasible designs as text; if none, the violations of the nearest one."""
        if not self.serves:
            return f"infeasible: the nearest design has {'; '.join(self.why)}"
        return self.count_text

    @property
    def least_margin(self) -> float:
        """The smallest drive margin: limit over load, the least of force, torque and speed."""
        return min(self.figures.get(f"{name}_margin", np.inf) for name in MARGINS)

    def summary(self) -> str:
        """Return a line of text: the kind of machine, then `verdict`."""
        return f"{self.kind}: {self.verdict}"

    @property
    def figure_texts(self) -> dict[str, str]:
        """Rounded figures of the machine as text, by table heading (mass, footprint, margin)."""
        row = {"drive margin": _ratio(self.least_margin)}
        for name, (heading, factor) in _FIGURES.items():
            figure = self.figures.get(name)
            if figure is not None and (figure or name not in ("cycle_time", "energy")):
                row[heading] = (
                    f"{factor * figure:.0f}" if figure > 1e3 else f"{factor * figure:.3g}"
                )
        return row

    @property
    def drive_text(self) -> str:
        """Numbers and names of the motors and gearboxes as text: "3 x motor + gearbox"."""
        return ", ".join(f"{count} x {name}" for name, count in Counter(self.drives).items())

    @property
    def dimension_text(self) -> str:
        """The machine's dimensions and the space that it needs as text, mm."""
        lengths = ", ".join(
            f"{name} {1e3 * length:.0f}" for name, length in self.dimensions.items()
        )
        extents = (f"{1e3 * self.figures[name]:.0f}" for name in ("width", "depth", "height"))
        return f"{lengths}; space that it needs {' x '.join(extents)}"

    @property
    def part_text(self) -> str:
        """What links are cut from, and numbers and names of joints and rails, as text."""
        links = [f"{key} links {stock}" for key, stock in self.stocks.items()]
        return ", ".join([*links, *(f"{count} x {name}" for name, count in self.parts.items())])

    @property
    def cycle_text(self) -> str:
        """What `pteron size` says of the cycle at its worst place; empty without a cycle."""
        figures = self.figures
        if "peak_torque" not in figures:
            return ""
        return (
            f"at {self.worst} the motors give at most {figures['peak_torque']:.3g} N m and "
            f"{figures['rms_torque']:.3g} N m root mean square, at up to "
            f"{figures['motor_speed']:.3g} rad/s; the drives give {figures['energy_given']:.3g} J "
            f"a cycle (elsewhere up to {figures['energy']:.3g} J) and brake "
            f"{figures['energy_braked']:.3g} J"
        )

    @property
    def margin_text(self) -> str:
        """The drives' margins as text, with the place in the workspace of the smallest."""
        names = {f"{name}_margin": word for name, word in MARGINS.items()}
        known = {word: self.figures[name] for name, word in names.items() if name in self.figures}
        ratios = ", ".join(f"{word} {_ratio(margin)}" for word, margin in known.items())
        return f"{ratios}; smallest at {self.worst}" if self.worst else ratios

    data = former_attribute("data", "as_dict")


def _ratio(margin: float) -> str:
    """Return a drive margin (limit over load) as text with three significant digits."""
    return f"{margin:.{2 if margin < 10.0 else 1 if margin < 100.0 else 0}f}"

"""Curves of legs over time, each in the colour and line style of its leg.

The first four colours are Okabe and Ito's, which the colour-blind can tell apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pteron.kernels import Array
from pteron.plots.ticks import fit_time_scale

LEG_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6500", "#6a3fa0")
"""Colours of legs 1 to 6."""

_LEG_STYLES = (
    "-",
    (0, (6, 1.5)),
    (0, (2, 1.2)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (3, 1.2, 1, 1.2)),
    (0, (1, 1)),
)
"""Line styles of legs 1 to 6, in every picture: colour alone does not survive every printer."""

_SAME = 0.004
"""Greatest distance of curves that coincide, over the range of all: less than a line is thick."""

_DASH = 4.0
"""Length of the dashes of curves that coincide, in widths of the line."""


def leg_style(i: int, width: float) -> dict[str, Any]:
    """Return the colour and style of a leg's line, with its width in points."""
    k = i % len(LEG_COLORS)
    return {"color": LEG_COLORS[k], "linestyle": _LEG_STYLES[k], "linewidth": width}


def leg_curves(
    axes: Axes,
    time: Array,
    curves: Array,
    columns: Iterable[int],
    width: float,
    names: Sequence[str] = (),
    noun: str = "",
) -> None:
    """Draw columns of values (T, n) over time (T,), each in its leg's style.

    A curve's label is its noun and name. Curves that coincide are dashes of one line in turn; the
    last one's label says so.
    """
    chosen = list(columns)
    shown = curves[:, chosen]
    near = _SAME * float(np.ptp(shown[np.isfinite(shown)])) if np.isfinite(shown).any() else 0.0
    for i in chosen:
        differences = np.abs(shown - curves[:, [i]])
        known = np.atleast_1d(np.isfinite(differences).any(axis=0))
        alike = [
            j
            for j, off, seen in zip(chosen, differences.T, known, strict=True)
            if seen and not (off > near).any()
        ]
        style, label = leg_style(i, width), f"{noun} {names[i]}".lstrip() if names else None
        if len(alike) > 1:
            turn, gap = alike.index(i), len(alike) - 1
            style |= {"linestyle": (-_DASH * turn, (_DASH, _DASH * gap)), "dash_capstyle": "butt"}
            if label and i == alike[-1]:
                label += f" (on {', '.join(names[j] for j in alike[:-1])})"
        axes.plot(time, curves[:, i], label=label, **style)
    fit_time_scale(axes, time)


def leg_numbers(count: int) -> list[str]:
    """Return the names of legs in a legend, behind the noun "leg"."""
    return [str(i) for i in range(1, count + 1)]

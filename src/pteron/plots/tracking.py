"""How well a simulated machine follows what it is told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pteron.kernels import Array
from pteron.plots.canvas import MUTED, blank, leg_style, legend, stack
from pteron.plots.joint_columns import rows

_SCALES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))


def tracking_figure(time: ArrayLike, error: ArrayLike, names: Sequence[str]) -> Figure:
    """Return the errors (T, m) of the pose over time (T,), s.

    `names` are its coordinates; the angle "phi", in rad, gets axes of its own, lengths are in m.
    """
    time, error = rows(time, error, "error", len(names))
    lengths = [i for i, name in enumerate(names) if name != "phi"]
    angles = [i for i, name in enumerate(names) if name == "phi"]
    groups = [(own, unit) for own, unit in ((lengths, "m"), (angles, "rad")) if own]
    scales = [_scale(error[:, own]) for own, _ in groups]
    labels = [
        f"error ({prefix}{unit})" for (_, unit), (_, prefix) in zip(groups, scales, strict=True)
    ]
    figure = blank(5.4, 1.6 + 1.6 * len(groups))
    for axes, (own, _), (factor, _) in zip(
        stack(figure, "time (s)", labels), groups, scales, strict=True
    ):
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        for i in own:
            axes.plot(time, factor * error[:, i], label=names[i], **leg_style(i, 1.4))
        axes.set_xlim(float(time[0]), float(time[-1]))
    legend(figure, len(names))
    return figure


def _scale(values: Array) -> tuple[float, str]:
    """Return the factor and the prefix with which the largest value is a number above one."""
    largest = float(np.abs(values).max(initial=0.0))
    return next((pair for pair in _SCALES if largest * pair[0] >= 1.0), _SCALES[-1])

"""Bode plot of the drives' loops, and the poles of a sampled loop beside the unit circle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import ArrayLike

from pteron.errors import DataError
from pteron.plots.canvas import INK, MUTED, blank, legend, plain_axes, real_figure, stack
from pteron.plots.leg_curves import leg_curves


def bode_figure(
    frequencies: ArrayLike,
    loops: Any,
    names: Sequence[str] | None = None,
    *,
    ax: Axes | SubFigure | None = None,
) -> Figure:
    """Return a picture of gain and phase of drive loops (W, n) over frequency (W,), rad/s.

    Lines mark the gain 1 and the phase -180 degrees.
    """
    omega, responses = np.asarray(frequencies, dtype=float), np.asarray(loops)
    if responses.ndim != 2 or omega.shape != responses.shape[:1]:
        raise DataError(
            f"loops: shape {responses.shape} given, a row for each of {omega.size} frequencies "
            "expected"
        )
    phase = np.degrees(np.unwrap(np.angle(responses), axis=0))
    # A loop of two integrators begins at -180 degrees, not at 180, one of a spring at 0.
    phase -= 360.0 * np.round((phase[0] + 90.0) / 360.0)
    figure = blank(5.4, 4.4, ax)
    axes = stack(figure, "frequency (rad/s)", ["gain", "phase (degrees)"])
    curves = list(range(responses.shape[1]))
    labels = list(names or (f"drive {i + 1}" for i in curves))
    for plot, curve, line in zip(axes, (np.abs(responses), phase), (1.0, -180.0), strict=True):
        leg_curves(plot, omega, curve, curves, 1.6, labels if plot is axes[0] else ())
        plot.axhline(line, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
        plot.set_xscale("log")
    axes[0].set_yscale("log")
    legend(figure, responses.shape[1])
    return real_figure(figure)


def poles_figure(poles: Any, *, ax: Axes | SubFigure | None = None) -> Figure:
    """Return a picture of a sampled loop's poles, complex, with the unit circle."""
    try:
        roots = np.asarray(poles, dtype=complex).ravel()
    except (TypeError, ValueError):
        raise DataError("poles: not an array of complex numbers") from None
    figure = blank(3.6, 3.6, ax)
    axes = plain_axes(figure, "real part of z", "imaginary part of z")
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    axes.plot(circle.real, circle.imag, color=MUTED, linewidth=1.0)
    axes.plot(roots.real, roots.imag, "x", color=INK, markersize=5.0)
    axes.set_aspect("equal")
    return real_figure(figure)

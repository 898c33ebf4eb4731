"""What the free part of the parameters is pulled to: the CAD model, or plain shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pteron.identification.consistency.bodies import Bodies
from pteron.kernels import Array
from pteron.reduction import BaseParameters

__all__ = ["Target", "cad_target", "plain_target"]

_MARGIN = 1e-3
_LEAST_MARGIN = 1e-6
"""How far inside its cone a body is kept, relative to its mass; a uniform rod is 0.067 inside."""


@dataclass(frozen=True)
class Target:
    """Minimise |matrix @ z - right| over the scaled free parameters z = free / scale.

    Attributes
    ----------
    scale : array, shape (columns,)
        Units of z: a mass of each body, and its length.
    margins : array, shape (sliders + bodies,)
        How far inside its cone each body is kept.
    """

    kind: Literal["CAD", "nothing"]
    scale: Array
    margins: Array
    matrix: Array
    right: Array


def cad_target(bodies: Bodies, cad: Array) -> Target:
    """Return the distance to CAD parameters (N,), each kind by the body's mass and length."""
    free = bodies.mean(cad)
    heads = np.concatenate([free[: bodies.sliders], free[bodies.sliders :: 4]])
    # An array from a drawing may hold any mass; a scale must be positive.
    typical = float(np.abs(heads).mean()) or 1.0
    scale = bodies.scale(np.maximum(np.abs(heads), 0.01 * typical))
    z = free / scale
    # A CAD model thinner than the margin stays its own nearest model.
    margins = np.clip(0.5 * bodies.least(z), _LEAST_MARGIN, _MARGIN)
    return Target("CAD", scale, margins, np.eye(len(z)), z)


def plain_target(bodies: Bodies, base: BaseParameters, values: Array) -> Target:
    """Return the deviation from uniform rods and a uniform disc, all of about one mass.

    Shapes are relative to the body's own mass, so that no mass is guessed: with c and k of a rod
    (1/2, 1/3) or a disc (0, 1/2), in lengths of the body, the sum over bodies of
    (m - mean)^2 + (hx - c m)^2 + hy^2 + (I - k m)^2. It is strictly convex, so that the answer
    is one, also where the forces leave a parameter entirely free (the platform's inertia of a
    Tripteron); an analytic centre would not exist there.
    """
    masses = [abs(v) for v, name in zip(values, base.names, strict=True) if name.startswith("m_")]
    typical = float(np.mean(masses)) if masses and np.mean(masses) > 0.0 else 1.0
    count = bodies.sliders + len(bodies.lengths)
    scale = bodies.scale(np.full(count, typical))
    rows = np.eye(len(scale))
    heads = [*range(bodies.sliders), *range(bodies.sliders, len(scale), 4)]
    for head, name in zip(heads, bodies.names, strict=True):
        rows[head, heads] -= 1.0 / count
        if name.startswith("p"):
            continue
        # The lower link's frame has its origin on R3 and x away from R2.
        center = {"u": 0.5, "l": -0.5, "e": 0.0}[name[0]]
        rows[head + 1, head] = -center
        rows[head + 3, head] = -0.5 if name == "e" else -1.0 / 3.0
    return Target("nothing", scale, np.full(count, _MARGIN), rows, np.zeros(len(scale)))

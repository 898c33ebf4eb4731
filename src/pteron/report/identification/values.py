"""Rows of an identification's report: each value and body, how well it is known, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from markupsafe import Markup

from pteron.bodies.inertia import Inertia, with_center
from pteron.bodies.parameters import PLATFORM
from pteron.identification import Identification
from pteron.identification.names_in_html import html_expressions, html_names
from pteron.kernels import Array

_STRONG = 0.95
"""Correlation from which two values can hardly be told apart."""

_NORMAL = 1.959963984540054
"""Half width of a 95 % interval of a normal variable, in standard deviations."""


@dataclass(frozen=True)
class ReportedParameter:
    """A value of the model, and whether the data determine it.

    `half` is half of its 95 % interval, `relative` its standard deviation over its size, `ratio`
    the inverse of that. The CAD model says nothing of friction and other terms. The partner is the
    value it is most strongly correlated with, where that is above 0.95.
    """

    name: str
    expression: Markup
    unit: str
    value: float
    half: float
    relative: float
    ratio: float
    cad: float | None
    status: Literal["essential", "dropped", "unseen"]
    partner: Markup | None
    correlation: float

    @property
    def weak(self) -> bool:
        """Whether the data hardly determine the value."""
        return self.status != "essential"


def parameter_rows(identification: Identification) -> tuple[ReportedParameter, ...]:
    """Return the values of an identification, in the model's order."""
    estimate, model = identification.estimate, identification.model
    base = model.base.values(identification.robot)
    expressions, names = html_expressions(model), html_names(model)
    partners, strengths = _partners(estimate.correlation)
    rows = []
    for k, name in enumerate(estimate.names):
        size, deviation = float(estimate.values[k]), float(estimate.deviations[k])
        status: Literal["essential", "dropped", "unseen"] = "essential"
        if name in (*identification.unseen, *identification.essential.dropped):
            status = "unseen" if name in identification.unseen else "dropped"
        rows.append(
            ReportedParameter(
                name=name,
                expression=expressions[k],
                unit=estimate.units[k],
                value=size,
                half=_NORMAL * deviation,
                relative=deviation / abs(size) if size else float("inf"),
                ratio=abs(size) / deviation if deviation > 0.0 else float("inf"),
                cad=float(base[k]) if k < model.base.rank else None,
                status=status,
                partner=names[estimate.names[partners[k]]] if abs(strengths[k]) > _STRONG else None,
                correlation=float(strengths[k]),
            )
        )
    return tuple(rows)


def _partners(correlation: Array) -> tuple[Array, Array]:
    """Return the most correlated other value of each value (p,), and the correlation (p,)."""
    p = len(correlation)
    off = np.where(np.eye(p, dtype=bool), 0.0, np.nan_to_num(correlation))
    partners = np.argmax(np.abs(off), axis=1)
    return partners, off[np.arange(p), partners]


@dataclass(frozen=True)
class ReportedBody:
    """A body as identified and as drawn.

    Values are the mass, kg; for a body that turns also the centre of mass, m, None where it has no
    such coordinate, and the moment of inertia about the body's reference point, kg m^2. A body on
    the border only just exists.
    """

    kind: str
    leg: int | None
    identified: tuple[float | None, ...]
    drawn: tuple[float | None, ...]
    border: bool


def body_rows(identification: Identification) -> tuple[ReportedBody, ...]:
    """Return the bodies of an identification; empty if no physical bodies exist."""
    consistency = identification.consistency
    if consistency is None:
        return ()
    # A name at the border may stand for a body of several legs.
    border = {
        (p.body, leg)
        for p in identification.model.base.parameters
        if p.owner in consistency.at_border
        for leg in p.legs or (None,)
    }
    identified, drawn = consistency.robot, identification.robot
    rows = [
        ReportedBody(
            leg.names[letter], i - 1, _values(body_inertia), _values(old), (letter, i) in border
        )
        for i, (leg, other) in enumerate(zip(identified.legs, drawn.legs, strict=True), start=1)
        for (letter, body_inertia), old in zip(
            leg.bodies.items(), other.bodies.values(), strict=True
        )
    ]
    body, cad = (_values(robot.platform.total_inertia) for robot in (identified, drawn))
    return (*rows, ReportedBody("platform", None, body, cad, (PLATFORM, None) in border))


def _values(inertia: Inertia) -> tuple[float | None, ...]:
    """Return m, mgx, mgy and I of an inertia with a moment of inertia, else its mass alone."""
    by_name = with_center(inertia)
    return tuple(map(by_name.get, ("m", "mgx", "mgy", "I"))) if "I" in by_name else (by_name["m"],)

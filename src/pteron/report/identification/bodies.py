"""The identified bodies beside those of the CAD model."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pteron.identification import Identification
from pteron.manipulator import Manipulator

__all__ = ["Body", "body_rows"]

_SHARED = re.compile(r"([pule])(\d*|\([\d,]+\))")


@dataclass(frozen=True)
class Body:
    """A body as it was identified and as it was drawn.

    Attributes
    ----------
    kind : str
        slider, upper link, lower link or platform.
    leg : int or None
        From 0.
    identified, drawn : tuple of float
        Mass, kg; for a link or the platform also the centre of mass, m, and the moment of inertia
        about the body's reference point, kg m^2.
    border : bool
        Whether it only just exists.
    """

    kind: str
    leg: int | None
    identified: tuple[float, ...]
    drawn: tuple[float, ...]
    border: bool


def body_rows(result: Identification) -> tuple[Body, ...]:
    """Return the bodies of an identification; none where there are no real ones."""
    consistency = result.consistency
    if consistency is None:
        return ()
    border = consistency.at_border
    identified, drawn = _bodies(consistency.robot), _bodies(result.robot)
    return tuple(
        Body(kind, leg, values, drawn[key][2], any(_is(key, name) for name in border))
        for key, (kind, leg, values) in identified.items()
    )


def _is(key: str, name: str) -> bool:
    """Say whether a body is one of those that share a name, such as u(2,4), or u of all legs."""
    found = _SHARED.fullmatch(name)
    if found is None:
        return False
    legs = re.findall(r"\d+", found[2])
    return key[0] == found[1] and (not legs or key[1:] in legs)


def _bodies(robot: Manipulator) -> dict[str, tuple[str, int | None, tuple[float, ...]]]:
    found: dict[str, tuple[str, int | None, tuple[float, ...]]] = {}
    for i, leg in enumerate(robot.legs):
        found[f"p{i + 1}"] = "slider", i, (leg.slider_mass,)
        for key, kind, body in (("u", "upper link", leg.upper), ("l", "lower link", leg.lower)):
            found[f"{key}{i + 1}"] = kind, i, (body.mass, *body.center_of_mass, body.inertia)
    body = robot.platform.inertia
    found["e"] = "platform", None, (body.mass, *body.center_of_mass, body.inertia)
    return found

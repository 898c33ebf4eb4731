"""Every kind of leg that files may name keeps the protocol, and what breaks it is told."""

from dataclasses import replace

import casadi as ca
import pytest
from mechanisms import CATALOG

from pteron.legs import KINDS
from pteron.legs.conformance import faults
from pteron.legs.prr import PRREquations
from pteron.legs.rss import RSSEquations

_LEGS = {
    f"{name} {i}": (leg, (robot.platform.rotation_axes or (None,))[0])
    for name, robot in CATALOG.items()
    for i, leg in enumerate(robot.legs, start=1)
}


def legs_of(kind: str) -> list[str]:
    """Return the legs of a kind among all machines."""
    return [name for name, (leg, _) in _LEGS.items() if leg.type == kind]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_leg_conforms(kind):
    names = legs_of(kind)
    assert names
    for seed, name in enumerate(names):
        assert faults(*_LEGS[name], seed=seed) == (), name


class Late(PRREquations):
    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        return found._replace(acceleration=1.001 * found.acceleration)


class Light(RSSEquations):
    def needs(self, point, rotation, gravity, inertia):
        found = super().needs(point, rotation, gravity, inertia)
        return found._replace(mass=0.999 * found.mass)


class Stray(PRREquations):
    def locus(self, q):
        found = super().locus(q)
        return found._replace(radius=found.radius + 1e-6)


class Loose(PRREquations):
    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        link = found.bodies["l"]
        return found._replace(bodies={**found.bodies, "l": link._replace(ddx=ca.SX(3, 1))})


@pytest.mark.parametrize(
    ("name", "equations", "words"),
    [
        ("3-prr 1", Late, "acceleration: not the derivative of rate"),
        ("delta 1", Light, "needs: not what its bodies need"),
        ("3-prr 2", Stray, "locus: c is not on it"),
        ("3-prr 1", Loose, 'body "l": ddx: not the second derivative of x'),
    ],
)
def test_what_a_kind_breaks_is_told(name, equations, words, monkeypatch):
    leg, axis = _LEGS[name]
    monkeypatch.setattr(type(leg), "equations_class", equations)
    assert any(words in fault for fault in faults(replace(leg), axis))

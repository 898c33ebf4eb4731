"""Every kind of leg, platform and closure keeps its protocol, and what breaks it is told."""

from dataclasses import replace

import casadi as ca
import pytest
import tilting
from mechanisms import CATALOG, GATE, MACHINES, states

from pteron.closures import conformance as of_closures
from pteron.legs import KINDS
from pteron.legs.conformance import faults
from pteron.legs.prr import PRREquations
from pteron.legs.rss import RSSEquations
from pteron.platforms import conformance as of_platforms
from pteron.platforms.sliding import Sliding
from pteron.platforms.turning import Turning

_LEGS = {
    f"{name} {i}": (leg, (robot.platform.rotation_axes or (None,))[0])
    for name, robot in CATALOG.items()
    for i, leg in enumerate(robot.legs, start=1)
}
_TILTED = [
    leg
    for motion, kinds in (*tilting.LEGS.items(), ("3T3R", ("PRRS",)), ("3R", ("SRRR",)))
    for seed in range(3)
    for leg in tilting.machine(motion, kinds, seed)[0].legs
]


def legs_of(kind: str) -> list[str]:
    """Return the legs of a kind among all machines."""
    return [name for name, (leg, _) in _LEGS.items() if leg.type == kind]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_leg_conforms(kind):
    names = legs_of(kind)
    tilted = [leg for leg in _TILTED if leg.type == kind]
    assert names or tilted
    for seed, name in enumerate(names):
        assert faults(*_LEGS[name], seed=seed) == (), name
    for seed, leg in enumerate(tilted):
        assert faults(leg, seed=seed, tilts=True) == ()


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


@pytest.mark.parametrize("name", GATE)
def test_every_kind_of_platform_conforms(name):
    assert of_platforms.faults(MACHINES[name].platform) == ()


@pytest.mark.parametrize("name", GATE)
def test_every_closure_conforms(name):
    robot = MACHINES[name]
    pose = states(robot, 1)[0][0]
    assert of_closures.faults(robot.legs, robot.platform, pose) == ()


@pytest.mark.parametrize(
    ("name", "kind", "method", "words"),
    [
        ("quadrupteron", Turning, "mass_matrix", "needs: its power is not the rate of the energy"),
        ("random PRSSI 0", Sliding, "needs", "needs: its power is not the rate of the energy"),
    ],
)
def test_what_a_platform_breaks_is_told(name, kind, method, words, monkeypatch):
    plain = getattr(kind, method)
    monkeypatch.setattr(kind, method, lambda *given: 1.001 * plain(*given))
    assert any(words in fault for fault in of_platforms.faults(MACHINES[name].platform))

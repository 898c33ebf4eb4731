"""Inertial parameters of a machine: their kinds, units, bodies, legs, names and order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

LENGTH_POWERS = {
    **dict.fromkeys(("m",), 0),
    **dict.fromkeys(("mgx", "mgy", "mgz"), 1),
    **dict.fromkeys(("I", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"), 2),
}
"""The kinds of inertial parameters, and the power of length in their unit: kg, kg m, kg m^2."""

LEG_BODIES = ("p", "u", "t", "l")
"""A leg's bodies by letter, in the order of the parameters: slider, upper link or crank, piston
between two links, lower link."""

LINK_BODIES = ("u", "l")
"""The bodies that are a leg's links: upper link or crank, lower link."""

PLATFORM = "e"
"""The letter of the platform."""

PREFERENCE = (
    *(("m", "p"), ("mgx", "u"), ("mgy", "u"), ("I", "u"), ("mgx", "l"), ("mgy", "l"), ("m", "e")),
    *(("m", "l"), ("mgx", "e"), ("mgy", "e"), ("I", "e"), ("I", "l"), ("m", "u")),
)
"""Kinds and bodies of parameters in the order in which base parameters keep them, as Table 1."""

TILTING_PREFERENCE = (
    *PREFERENCE[:6],
    *((kind, "t") for kind in ("mgx", "mgy", "I")),
    ("mgz", "l"),
    *((kind, "e") for kind in LENGTH_POWERS if kind != "I"),
    *((kind, "l") for kind in LENGTH_POWERS if kind[0] == "I"),
    *(("m", "l"), ("m", "t"), ("m", "u")),
)
"""The same under a platform that tilts: its own parameters are kept, before masses on it."""

JOINED = (("m", "u"), ("mgx", "l"))
"""Parameters that the cheapest model drops: m_u joins the slider, and m gamma_x of a lower link is
masses at its ends."""

OWN = (("m", "p"), ("I", "u"), ("mgx", "u"), ("mgy", "u"), ("I", "l"), ("mgy", "l"))
"""Parameters that the cheapest model keeps, if they act at all."""

_UNITS = ("kg", "kg m", "kg m^2")


def unit_of(kind: str) -> str:
    """Return the SI unit of a kind of inertial parameter: "kg", "kg m" or "kg m^2"."""
    return _UNITS[LENGTH_POWERS[kind]]


@dataclass(frozen=True)
class Parameter:
    """One inertial parameter, or one that several legs share.

    Parameters
    ----------
    kind : str
        ``"m"`` (mass), ``"mgx"``, ``"mgy"`` (first moments m gamma_x and m gamma_y) or ``"I"``;
        of a platform that tilts also ``"mgz"``, and ``"Ixx"`` .. ``"Izz"`` in place of ``"I"``.
    body : str
        ``"p"`` (slider), ``"u"`` (upper link or crank), ``"l"`` (lower link or rod), ``"e"``
        (platform).
    legs : tuple of int
        The legs whose body it belongs to, from 1; empty for the platform.
    unit : str
        Its SI unit.
    everyone : bool
        Whether all legs share it: its name then has no number.
    """

    kind: str
    body: str
    legs: tuple[int, ...]
    unit: str
    everyone: bool = False

    @property
    def name(self) -> str:
        """The parameter's name: ``mgx_u1`` is m gamma_x of leg 1's upper link."""
        return f"{self.kind}_{self.body}{self.suffix}"

    @property
    def owner(self) -> str:
        """The name of the parameter's body: ``u1``, ``l(2,4)``, ``e``."""
        return f"{self.body}{self.suffix}"

    @property
    def suffix(self) -> str:
        """The leg numbers at the end of the parameter's name: "1", "(2,4)" or ""."""
        if self.everyone or not self.legs:
            return ""
        return str(self.legs[0]) if len(self.legs) == 1 else f"({','.join(map(str, self.legs))})"

    @property
    def length_power(self) -> int:
        """The power of length in the parameter's unit: 0, 1 or 2."""
        return LENGTH_POWERS[self.kind]


def body_places(parameters: Iterable[Parameter]) -> dict[str, dict[str, int]]:
    """Return the index of each parameter, by its body's name and then its kind."""
    places: dict[str, dict[str, int]] = {}
    for k, parameter in enumerate(parameters):
        places.setdefault(parameter.owner, {})[parameter.kind] = k
    return places


def parameter_list(
    legs: Sequence[Mapping[str, Iterable[str]]],
    platform: Sequence[str],
    groups: Sequence[tuple[int, ...]] | None = None,
) -> tuple[Parameter, ...]:
    """Return the inertial parameters in the paper's order, Eq. (16).

    Sliders first, then upper links and cranks, then lower links and rods, then the platform; bodies
    that a leg lacks are omitted.

    Parameters
    ----------
    legs : sequence of mapping
        For each leg the kinds of parameters of each of its bodies, by letter.
    platform : sequence of str
        The kinds of the platform's.
    groups : sequence of tuple of int, optional
        Legs, from 1, that share one parameter set; those of a group have the same bodies.
    """
    groups = groups or [(i + 1,) for i in range(len(legs))]
    leg_parameters = [
        Parameter(kind, body, group, unit_of(kind), 1 < len(legs) == len(group))
        for body in LEG_BODIES
        for group in groups
        for kind in legs[group[0] - 1].get(body, ())
    ]
    platform_parameters = [Parameter(kind, PLATFORM, (), unit_of(kind)) for kind in platform]
    return (*leg_parameters, *platform_parameters)  # Eq. (16)

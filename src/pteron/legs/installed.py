"""Kinds of legs by name: those of this folder, and those that installed packages bring.

A package names its kinds as entry points of the group `pteron.legs`; its module is imported when a
file asks for the kind, not before.
"""

from __future__ import annotations

from pteron.errors import ModelError
from pteron.extensions import extension_names, extension_value, load_extension
from pteron.legs.kind import LegKind
from pteron.legs.prr import PRR
from pteron.legs.prrr import PRRR
from pteron.legs.prrs import PRRS
from pteron.legs.prs import PRS
from pteron.legs.prur import PRUR
from pteron.legs.pss import PSS
from pteron.legs.rpr import RPR
from pteron.legs.rps import RPS
from pteron.legs.rpur import RPUR
from pteron.legs.rrr import RRR
from pteron.legs.rrs import RRS
from pteron.legs.rss import RSS
from pteron.legs.rupu import RUPU
from pteron.legs.srrr import SRRR
from pteron.legs.ups import UPS
from pteron.legs.upu import UPU

GROUP = "pteron.legs"

KINDS: dict[str, type[LegKind]] = {
    kind.type: kind
    for kind in (
        PRRR,
        PSS,
        RSS,
        RRR,
        PRR,
        RPR,
        RUPU,
        UPS,
        RPS,
        PRS,
        RRS,
        PRRS,
        PRUR,
        RPUR,
        SRRR,
        UPU,
    )
}
"""The kinds of legs that are loaded, by their key `type`; add another here."""


Leg = PRRR
"""The default kind of leg, of files without `type`."""


def kind_names() -> tuple[str, ...]:
    """Return the names of all kinds of legs, built-in and of installed packages."""
    return (*KINDS, *(name for name in extension_names(GROUP) if name not in KINDS))


def kind_named(name: str) -> type[LegKind] | None:
    """Return the class of a kind of leg by its name, also from a package; None if unknown.

    Raises
    ------
    ModelError
        If the package that has it cannot be imported, or holds no kind of that name.
    """
    if name not in KINDS and (kind := load_extension(GROUP, name)) is not None:
        if not (isinstance(kind, type) and issubclass(kind, LegKind) and kind.type == name):
            value = extension_value(GROUP, name)
            raise ModelError(f"{value} is no kind of leg with type {name!r}")
        KINDS[name] = kind
    return KINDS.get(name)

"""Kinds of legs by name: those of this folder, and those that installed packages bring.

A package names its kinds as entry points of the group `pteron.legs`; its module is imported when a
file asks for the kind, not before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pteron.errors import ModelError
from pteron.legs.kind import LegKind
from pteron.legs.prr import PRR
from pteron.legs.prrr import PRRR
from pteron.legs.prs import PRS
from pteron.legs.pss import PSS
from pteron.legs.rpr import RPR
from pteron.legs.rps import RPS
from pteron.legs.rrr import RRR
from pteron.legs.rrs import RRS
from pteron.legs.rss import RSS
from pteron.legs.rupu import RUPU
from pteron.legs.ups import UPS

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "pteron.legs"

KINDS: dict[str, type[LegKind]] = {
    kind.type: kind for kind in (PRRR, PSS, RSS, RRR, PRR, RPR, RUPU, UPS, RPS, PRS, RRS)
}
"""The kinds of legs that are loaded, by their key `type`; add another here."""


Leg = PRRR
"""The default kind of leg, of files without `type`."""


def kind_names() -> tuple[str, ...]:
    """Return the names of all kinds that files may name."""
    return (
        *KINDS,
        *sorted(
            entry_point.name for entry_point in _entry_points() if entry_point.name not in KINDS
        ),
    )


def kind_named(name: str) -> type[LegKind] | None:
    """Return a kind of leg by its name, of an installed package too; None if there is none.

    Raises
    ------
    ModelError
        If the package that has it cannot be imported, or holds no kind of that name.
    """
    entry_point = (
        next((e for e in _entry_points() if e.name == name), None) if name not in KINDS else None
    )
    if entry_point is not None:
        KINDS[name] = _load_kind(entry_point)
    return KINDS.get(name)


def _entry_points() -> tuple[EntryPoint, ...]:
    from importlib.metadata import entry_points

    return tuple(entry_points(group=GROUP))


def _load_kind(entry_point: EntryPoint) -> type[LegKind]:
    try:
        kind = entry_point.load()
    except Exception as error:
        raise ModelError(f"{entry_point.value}: {type(error).__name__}: {error}") from error
    if not (isinstance(kind, type) and issubclass(kind, LegKind) and kind.type == entry_point.name):
        raise ModelError(f"{entry_point.value} is no kind of leg with type {entry_point.name!r}")
    return kind

"""Kinds of legs, one file each; `legs.leg` is the page to read before writing another."""

from pteron.legs.cones import Cone
from pteron.legs.drive import Drive, Stribeck
from pteron.legs.installed import KINDS
from pteron.legs.kind import LegKind
from pteron.legs.prr import PRR
from pteron.legs.prrr import PRRR
from pteron.legs.pss import PSS
from pteron.legs.rpr import RPR
from pteron.legs.rrr import RRR
from pteron.legs.rss import RSS
from pteron.legs.rupu import RUPU

__all__ = [
    "KINDS",
    "PRR",
    "PRRR",
    "PSS",
    "RPR",
    "RRR",
    "RSS",
    "RUPU",
    "Cone",
    "Drive",
    "LegKind",
    "Stribeck",
]


def __dir__() -> list[str]:
    return sorted(__all__)

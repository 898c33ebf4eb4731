"""Kinds of legs, one file each; `legs.leg` is the page to read before writing another."""

from pteron.legs.cones import Cone
from pteron.legs.drive import Drive, Stribeck
from pteron.legs.installed import KINDS
from pteron.legs.kind import LegKind
from pteron.legs.prr import PRR
from pteron.legs.prrr import PRRR
from pteron.legs.prs import PRS
from pteron.legs.pss import PSS
from pteron.legs.reading import Reading
from pteron.legs.rpr import RPR
from pteron.legs.rps import RPS
from pteron.legs.rrr import RRR
from pteron.legs.rrs import RRS
from pteron.legs.rss import RSS
from pteron.legs.rupu import RUPU
from pteron.legs.ups import UPS

__all__ = [
    "KINDS",
    "PRR",
    "PRRR",
    "PRS",
    "PSS",
    "RPR",
    "RPS",
    "RRR",
    "RRS",
    "RSS",
    "RUPU",
    "UPS",
    "Cone",
    "Drive",
    "LegKind",
    "Reading",
    "Stribeck",
]


def __dir__() -> list[str]:
    return sorted(__all__)

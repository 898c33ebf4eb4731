from pteron.legs.cones import Cone as Cone
from pteron.legs.drive import (
    Drive as Drive,
    Elastic as Elastic,
    LuGre as LuGre,
    Stribeck as Stribeck,
    Wave as Wave,
    Winding as Winding,
)
from pteron.legs.installed import KINDS as KINDS, Leg as Leg
from pteron.legs.kind import LegKind as LegKind
from pteron.legs.prr import PRR as PRR
from pteron.legs.prrr import PRRR as PRRR
from pteron.legs.prrs import PRRS as PRRS
from pteron.legs.prs import PRS as PRS
from pteron.legs.prur import PRUR as PRUR
from pteron.legs.pss import PSS as PSS
from pteron.legs.reading import Reading as Reading
from pteron.legs.rpr import RPR as RPR
from pteron.legs.rps import RPS as RPS
from pteron.legs.rpur import RPUR as RPUR
from pteron.legs.rrr import RRR as RRR
from pteron.legs.rrs import RRS as RRS
from pteron.legs.rss import RSS as RSS
from pteron.legs.rupu import RUPU as RUPU
from pteron.legs.screw import Screw as Screw
from pteron.legs.srrr import SRRR as SRRR
from pteron.legs.ups import UPS as UPS
from pteron.legs.upu import UPU as UPU

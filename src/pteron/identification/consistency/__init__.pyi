from pteron.identification.consistency.bodies import real_bodies as real_bodies
from pteron.identification.consistency.bounds import Bounds as Bounds
from pteron.identification.consistency.cones import MissingSolver as MissingSolver
from pteron.identification.consistency.consistency import Consistency as Consistency
from pteron.identification.consistency.consistent_model import (
    consistent_model as consistent_model,
)

"""Real bodies for identified base parameters: masses above zero, inertias that a body can have."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.identification.consistency.bodies import real_bodies as real_bodies
    from pteron.identification.consistency.bounds import Bounds as Bounds
    from pteron.identification.consistency.cones import MissingSolver as MissingSolver
    from pteron.identification.consistency.consistency import Consistency as Consistency
    from pteron.identification.consistency.consistent_model import (
        consistent_model as consistent_model,
    )

_publish(__name__)

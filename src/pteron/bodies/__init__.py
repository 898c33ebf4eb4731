"""Rigid bodies: their inertia, inertial parameters and motion, and vectors in space."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.bodies.inertia import (
        PlanarInertia as PlanarInertia,
        RodInertia as RodInertia,
        SpatialInertia as SpatialInertia,
    )
    from pteron.bodies.parameters import Parameter as Parameter

_publish(__name__)

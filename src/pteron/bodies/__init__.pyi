from pteron.bodies.inertia import (
    PlanarInertia as PlanarInertia,
    RodInertia as RodInertia,
    SpatialInertia as SpatialInertia,
)
from pteron.bodies.parameters import Parameter as Parameter

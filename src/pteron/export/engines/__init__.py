"""Models for physics engines (MJCF, SDF, URDF, Pinocchio), made from one tree of bodies."""

from pteron.public import publish as _publish

_publish(__name__)

"""Kinds of legs, one file each; read `legs.leg` before you write another."""

from pteron.public import publish as _publish

_publish(__name__)

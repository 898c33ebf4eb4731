"""Kinds of legs, one file each; `legs.leg` is the page to read before writing another."""

from pteron.public import publish as _publish

_publish(__name__)

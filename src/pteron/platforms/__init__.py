"""Kinds of platforms, entered in `kinds.py`; read `platforms.motion` before you write another."""

from pteron.public import publish as _publish

_publish(__name__)

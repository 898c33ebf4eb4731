"""A robot as a value: legs, platform and gravity, its TOML files, and the catalog."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)

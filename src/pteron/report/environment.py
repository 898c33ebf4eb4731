"""The environment of the pages' templates: strict, escaped, and with the filters they share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jinja2

from pteron.report.digits import compact, fixed, significant

__all__ = ["environment"]


def environment(folder: str, **filters: Callable[..., Any]) -> jinja2.Environment:
    """Return the environment of a folder of the package, with filters of its own beside."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("pteron", folder),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {
        "compact": compact,
        "fixed": fixed,
        "significant": significant,
        "unit": lambda text: text.replace(" ", "\u202f").replace("^2", "²"),
        **filters,
    }
    return made

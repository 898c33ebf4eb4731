"""Loading of Jinja templates for HTML: undefined names are errors, values are escaped."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2


def template(folder: str, name: str, **filters: Callable[..., Any]) -> jinja2.Template:
    """Return the Jinja template `name` of a folder inside the package, with extra filters.

    A template may extend or include others of its folder.
    """
    # Slow to load, and needed only when a page or a notebook's table is made.
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pteron", folder),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters
    return environment.get_template(name)

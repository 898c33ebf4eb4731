"""Imports of modules that optional extras bring, or an error with the pip command for the extra."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pteron.errors import PteronError


def import_extra(extra: str, module: str, need: str, error: type[PteronError] | None = None) -> Any:
    """Import a module of an optional extra; raise an error with the install command if missing.

    Parameters
    ----------
    extra : str
        The extra's name.
    module : str
        The module's name, with its packages.
    need : str
        Who needs what, as the message begins: "films need FFmpeg".
    error : type of PteronError, optional
        The error that is raised, by default `ModelError`.
    """
    try:
        return import_module(module)
    except ImportError:
        # Where nothing of Pteron is installed, this file still runs for its command.
        from pteron.errors import ModelError

        message = f"{need}, which is not installed; {install_command(extra)}"
        raise (error or ModelError)(message) from None


def expect_extra(extra: str, module: str, need: str) -> None:
    """Raise an error with the install command if a module of an optional extra is missing.

    The parameters are those of `import_extra`; the module's name has no dots.
    """
    if find_spec(module) is None:
        import_extra(extra, module, need)


def install_command(extra: str) -> str:
    """Return the shell command that installs an optional extra of Pteron.

    Pteron may come from a source folder, a wheel, a repository or a registry; pip records which
    (PEP 610, direct_url.json).
    """
    return f"{_quote_path(sys.executable or 'python')} -m pip install {_requirement(extra)}"


def _requirement(extra: str) -> str:
    """Return pip's requirement text for an extra, by where Pteron was installed from."""
    # Only where something is missing: these are slow to import.
    import json
    from importlib.metadata import PackageNotFoundError, distribution
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    name = f"pteron[{extra}]"
    try:
        record = distribution("pteron").read_text("direct_url.json")
    except PackageNotFoundError:  # it runs from a folder of sources
        return f'--editable "{Path(__file__).parents[2]}[{extra}]"'
    if record is None:
        return f'"{name}"'
    origin = json.loads(record)
    url = origin["url"]
    if "dir_info" in origin:
        option = "--editable " if origin["dir_info"].get("editable") else ""
        return f'{option}"{url2pathname(urlsplit(url).path)}[{extra}]"'
    if "vcs_info" in origin:
        return f'"{name} @ {origin["vcs_info"]["vcs"]}+{url}@{origin["vcs_info"]["commit_id"]}"'
    return f'"{name} @ {url}"'


def _quote_path(path: str) -> str:
    """Return a path in quotation marks if it contains blanks, else unchanged."""
    return f'"{path}"' if " " in path else path

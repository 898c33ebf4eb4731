"""`kept_machine`: a machine from its file, which is read and checked once and then kept on disk."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pteron.manipulator import Manipulator

_READING = ("arguments", "errors", "toml")
"""The modules at the top that read a file, or word its warnings."""


def kept_machine(name_or_path: str) -> tuple[Manipulator, tuple[str, ...]]:
    """Return a machine, cached, and the warnings that `pteron.load` gives of its file.

    What is kept is that of the very bytes of the file, and of the sources and the Pydantic that
    read them. A machine with a leg from outside this package is read again each time.
    """
    from pydantic import VERSION

    from pteron.kernels.program_cache import cached_result, name_of
    from pteron.manipulator.files import contents, read_machine

    content, source = contents(name_or_path)
    return cached_result(
        ("machine", content.decode("latin-1"), source, name_or_path, VERSION),
        _READING,
        lambda: read_machine(content, source, name_or_path),
        keeps=lambda machine: name_of(machine[0]) is not None,
    )

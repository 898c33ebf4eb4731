"""Modules that are imported lazily, files beside them, and the versions that cache keys have."""

from PyInstaller.utils.hooks import (  # type: ignore[import-untyped]
    collect_data_files,
    collect_submodules,
    copy_metadata,
)

_BACKENDS = [f"matplotlib.backends.backend_{name}" for name in ("agg", "pdf", "svg")]
"""They are imported by the ending of a picture's file."""


def _is_needed(module: str) -> bool:
    """Return whether an application needs a module (dotted name): not this package's hooks."""
    return not module.startswith("pteron.__pyinstaller")


hiddenimports = collect_submodules("pteron", filter=_is_needed, on_error="ignore") + _BACKENDS
datas = collect_data_files("pteron") + copy_metadata("pteron", recursive=True)

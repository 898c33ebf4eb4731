"""The folder of the hook by which PyInstaller puts Pteron into an application."""

from pathlib import Path


def hook_folders() -> list[str]:
    """Return the folder that PyInstaller reads `hook-pteron.py` from."""
    return [str(Path(__file__).parent)]

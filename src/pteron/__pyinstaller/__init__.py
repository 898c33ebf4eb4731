"""What PyInstaller needs to put Pteron into an application: the folder of its hook."""

from pathlib import Path


def hook_folders() -> list[str]:
    """Return the folder that PyInstaller reads `hook-pteron.py` from."""
    return [str(Path(__file__).parent)]

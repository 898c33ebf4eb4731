"""README for package registries: there its links and pictures lead to the repository.

A registry shows README without the files beside it. Whoever publishes sets `[project.urls]`
Repository in pyproject.toml; then each relative link of README is one into that repository, at the
release's tag. Without it README stays as it is.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


def with_addresses(text: str, repository: str, version: str) -> str:
    """Return Markdown whose relative links lead into a repository: pictures as raw files."""

    def led(found: re.Match[str]) -> str:
        kind = "raw" if found[1] else "blob"
        return f"{found[1]}[{found[2]}]({repository.rstrip('/')}/{kind}/v{version}/{found[3]})"

    return re.sub(r"(!?)\[([^]]*)\]\((?!https?://|#)([^)]+)\)", led, text)


class CustomMetadataHook(MetadataHookInterface):
    """Gives the project its readme."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the readme, with addresses where the repository is known."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        repository = metadata.get("urls", {}).get("Repository")
        if repository:
            text = with_addresses(text, repository, metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}

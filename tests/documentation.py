"""Texts of the documentation."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parent.parent


DOCS = ROOT / "docs"


MADE = ("_build", "gallery", "measured", "commands", "functions", "inside", "modules")
"""Folders of docs that `make docs` fills."""


PAGES = sorted(
    (
        *ROOT.glob("[!C]*.md"),
        ROOT / "CONTRIBUTING.md",
        *(p for p in DOCS.rglob("*.md") if not {*p.parts} & {*MADE}),
    ),
)


TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}

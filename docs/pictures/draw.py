"""Make every picture and table of README and docs anew: `python docs/pictures/draw.py`.

What looks as it did stays as it is, to the byte; what does not is replaced, and named. With --check
it is named only, and the exit code is 1.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import catalog
import cycle
import engines
import film
import index_maps
import keys
import legs
import vectors
import view_page
from alike import alike

DOCS = Path(__file__).parents[1]

DRAWN: dict[str, Callable[[Path], None]] = {
    "catalog": catalog.draw,
    "cycle": cycle.draw,
    "engines": engines.draw,
    "film": film.draw,
    "legs": legs.draw,
    "index_maps": index_maps.draw,
    "vectors": vectors.draw,
    "view_page": view_page.draw,
}
"""Writers of each group of pictures into a folder laid out as docs, by the script's name."""


def main() -> None:
    """Draw all of them, and say which have changed."""
    check, changed = "--check" in sys.argv, False
    if not check:
        keys.write(DOCS / "robot-file.md")
    with TemporaryDirectory() as name:
        folder = Path(name)
        with ProcessPoolExecutor() as pool:
            for drawn in [pool.submit(draw, folder) for draw in DRAWN.values()]:
                drawn.result()
        for picture in sorted(path for path in folder.rglob("*") if path.is_file()):
            kept = DOCS / picture.relative_to(folder)
            if not alike(kept, picture):
                changed = True
                word = "differs" if check else "drawn anew"
                print(f"{word}: {kept.relative_to(DOCS.parent)}", flush=True)
                if check:
                    continue
                kept.parent.mkdir(exist_ok=True)
                shutil.copy(picture, kept)
    sys.exit(check and changed)


if __name__ == "__main__":
    main()

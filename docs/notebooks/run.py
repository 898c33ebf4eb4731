"""Run the notebooks from top to bottom, each in an empty folder, and print their times.

    python docs/notebooks/run.py              # all of them
    python docs/notebooks/run.py 3 5          # the third and the fifth
    python docs/notebooks/run.py --out FOLDER # and keep them, with what they showed

An error in a cell ends it. The notebooks themselves stay as they are: without outputs.
"""

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parent


def run(path: Path, out: Path | None = None) -> float:
    """Execute a notebook, write what it showed to a folder, and return the seconds it took."""
    notebook = nbformat.read(path, as_version=4)
    start = perf_counter()
    try:
        with TemporaryDirectory() as folder:
            place = {"metadata": {"path": folder}}
            NotebookClient(notebook, timeout=600, kernel_name="python3", resources=place).execute()
    finally:  # what it showed until then helps to find an error
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            nbformat.write(notebook, out / path.name)
    return perf_counter() - start


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("numbers", nargs="*", type=int, help="which notebooks; all by default")
    parser.add_argument("--out", type=Path, help="where to write them with their outputs")
    given = parser.parse_args()
    for path in sorted(FOLDER.glob("*.ipynb")):
        if not given.numbers or int(path.name.split("-")[0]) in given.numbers:
            print(f"{path.name}: {run(path, given.out):.1f} s")
            sys.stdout.flush()


if __name__ == "__main__":
    main()

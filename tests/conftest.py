"""Programs are kept from run to run, and compiled code is only asked for by the tests about it.

Pages are tried in the Chromium of the machine; where there is none these tests are left out,
unless PTERON_BROWSER is set, which then names it.
"""

import gc
import os
import shutil
import signal
from collections.abc import Generator, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
import typer.testing

# What is kept is named after the source that it depends on, see test_kept.
_CACHE = Path(__file__).parent.parent / ".pytest_cache" / "pteron"
os.environ.setdefault("PTERON_CACHE", str(_CACHE))
os.environ.setdefault("PTERON_KERNELS", "vm")

# Graphs of equations are many small objects without cycles: looking for those takes a twentieth.
gc.set_threshold(100_000, 50, 50)

# A command line is run as in a shell, but all commands are put together once a process.
typer.testing._get_command = lru_cache(typer.testing._get_command)  # type: ignore[attr-defined]

# What a shell starts in the background ignores Ctrl-C; the tests of interruption want it.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Generator[None, list[Any], list[Any]]:
    """Leave out the search for examples in docstrings of the tests, which have none."""
    found = yield
    return [one for one in found if type(one) is pytest.Module]


def pytest_collection_finish() -> None:
    """Leave modules and tests out of the search for cycles, which pytest makes at its end too."""
    gc.freeze()


def pytest_sessionfinish() -> None:
    """Search for cycles once, and leave what is there out of the five searches of pytest."""
    gc.collect()
    gc.freeze()


_FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless browser, for the tests of a module; WebGL is drawn by the processor."""
    program = os.environ.get("PTERON_BROWSER") or shutil.which("chromium")
    if program is None:
        pytest.skip("no Chromium on this machine; PTERON_BROWSER may name one")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(
            executable_path=program, args=[*_FLAGS, "--use-gl=angle", "--use-angle=swiftshader"]
        )
        yield opened
        opened.close()

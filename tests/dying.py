"""Work for other processes, one of which dies at it: once."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import polars as pl


def rows(number):
    """Return what a chunk of a sweep gives."""
    return pl.DataFrame({"number": [number] * 3, "root": np.sqrt(number + np.arange(3.0))})


def slow_rows(number):
    """Return the same after a time in which its process may be killed."""
    time.sleep(0.05)
    return rows(number)


def dies_once(flag, function, where, chunk):
    """Return what a function makes of a chunk; who first is at the one in question is killed."""
    if chunk == where:
        try:
            Path(flag).touch(exist_ok=False)
        except FileExistsError:
            pass
        else:
            os.kill(os.getpid(), signal.SIGKILL)
    return function(chunk)

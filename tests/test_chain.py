"""From a log to a running machine: the benchmark's chain, short, on the simulated Delta."""

import sys
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS

FOLDER = Path(__file__).parent.parent / "benchmarks" / "identification"


@CLIENTS
def test_exported_code_of_what_was_identified_runs_the_machine(tmp_path):
    """Excite, record, identify, export, compile, and follow a cycle that was held out."""
    pytest.importorskip("mujoco")
    sys.path.insert(0, str(FOLDER))
    try:
        import chain
    finally:
        sys.path.remove(str(FOLDER))
    (delta,) = (case for case in chain.CASES if case.name == "delta")
    outcome = chain.run(delta, tmp_path, duration=4.0, seconds=1.0, cycles=1)
    assert outcome.prediction.max() < 1.5
    assert outcome.gains.min() > 5.0
    # It is the identified friction that does it, not the drawing's bodies alone.
    assert (outcome.tracking["the drawing"] > 5.0 * outcome.tracking["exported C"]).all()
    # Without it the machine is neither lost nor at its place: both runs follow the cycle.
    assert np.abs(outcome.tracking["nothing"]).max() < 0.05

"""From a log to a running machine: the benchmark's chain, short, on the simulated Delta."""

import sys
from pathlib import Path

import numpy as np
import pytest
from mechanisms import CLIENTS

FOLDER = Path(__file__).parent.parent / "benchmarks" / "identification"


@CLIENTS
def test_exported_code_of_what_was_identified_runs_the_machine(tmp_path, monkeypatch):
    """Excite, record, identify, export, compile, and follow a cycle that was held out.

    MuJoCo's machine and Pteron's own do the same, for every figure of the way.
    """
    pytest.importorskip("mujoco")
    monkeypatch.delenv("PTERON_KERNELS", raising=False)  # ten thousand samples a second, in C
    sys.path.insert(0, str(FOLDER))
    try:
        import chain
    finally:
        sys.path.remove(str(FOLDER))
    (delta,) = (case for case in chain.CASES if case.name == "delta")
    outcomes = {}
    for twin in chain.twins(delta):
        folder = tmp_path / twin
        folder.mkdir()
        one = outcomes[twin] = chain.run(delta, twin, folder, duration=4.0, seconds=1.0, cycles=1)
        assert one.found.verdict.grade == "trustworthy"
        assert one.prediction.max() < 1.5
        assert one.gains.min() > 5.0
        # It is the identified friction that does it, not the drawing's bodies alone.
        assert (one.tracking["the drawing"] > 5.0 * one.tracking["exported C"]).all()
        # Without it the machine is neither lost nor at its place: both runs follow the cycle.
        assert np.abs(one.tracking["nothing"]).max() < 0.05
    theirs, ours = outcomes["MuJoCo"], outcomes["Pteron"]
    for name, recorded in theirs.recordings.items():
        # Pteron's controller holds forces for 0.1 ms, which is half of that late.
        for what, most in (("joints", 1e-5), ("forces", 2e-3)):
            true = getattr(recorded, what)
            off = getattr(ours.recordings[name], what) - true
            assert np.sqrt((off**2).mean()) < most * np.sqrt((true**2).mean())
    assert ours.prediction == pytest.approx(theirs.prediction, rel=0.02)

"""The machines of the gate stand for all others; `mechanisms.GATE` says how they were chosen."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import tilting
from mechanisms import CATALOG, GATE, MACHINES, MIXTURES, NIGHTLY, TURNS, random_machine
from test_multipteron import NAMES, drawn

from pteron.closures import KINDS as CLOSURES
from pteron.closures.redundant_loci import RedundantLoci
from pteron.equations.machine import Machine
from pteron.legs import KINDS as LEGS

CHOSEN = [MACHINES[name] for name in GATE]
TILTED = [tilting.machine(*case, 3)[0] for case in tilting.LEGS.items()]  # those of test_tilting
CHOSEN += TILTED
CHOSEN += [drawn(name, seed % 3)[0] for seed, name in enumerate(NAMES)]  # of test_multipteron


def served(robots):
    """Return the closures of machines, each with the platform under which it stands.

    Those of redundant machines are those of `test_redundancy`.
    """
    return {
        (type(Machine.numeric(robot).closure), robot.platform.kind)
        for robot in robots
        if not robot.redundancy
    }


def test_every_closure_is_there_under_each_platform_that_it_serves():
    every = [*CATALOG.values(), *MACHINES.values(), *(random_machine(0, k) for k in MIXTURES)]
    every += CHOSEN
    assert served(CHOSEN) == served(every)
    assert {closure for closure, _ in served(CHOSEN)} == set(CLOSURES) - {RedundantLoci}


def test_every_kind_of_leg_is_there():
    of_multipterons = {"PRRS", "PRUR", "RPUR", "SRRR", "UPU"}  # see `test_multipteron`
    types = {leg.type for robot in CHOSEN for leg in robot.legs}
    assert types | of_multipterons == set(LEGS)


def test_both_sides_of_each_choice_are_there():
    choices = {
        "elbow": lambda robot: {leg.elbow for leg in robot.legs} == {1, -1},
        "mixed legs": lambda robot: len({leg.type for leg in robot.legs}) > 1,
        "of the catalog": lambda robot: robot in CATALOG.values(),
        "bars": lambda robot: bool(robot.platform.bars),
        "gears": lambda robot: bool(robot.platform.geared),
        "gravity askew": lambda robot: (
            np.abs(np.cross(robot.gravity, robot.platform.axis)).max() > 1e-9
        ),
    }
    for choice, of in choices.items():
        assert {of(robot) for robot in CHOSEN} == {True, False}, choice


def test_in_each_file_every_machine_of_its_gate_has_a_turn():
    assert [file for (file, *gate), taken in TURNS.items() if taken != set(gate)] == []


@NIGHTLY
def test_the_table_says_which_cases_wait():
    code = "import waiting; print(waiting.parts()[1] == waiting.table())"
    run = [sys.executable, "-c", code]
    folder = Path(__file__).parent
    done = subprocess.run(run, cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True", "run python tests/waiting.py"

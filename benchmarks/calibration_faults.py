"""Calibrations with faults: whether each is named, and no error is above the stated one.

    python benchmarks/calibration_faults.py [SEEDS [FIRST] | --quick]

Seven machines and instruments, 14 faults and none, simulated in NumPy by
tests/calibration_plants.py, with SEEDS seeds from FIRST on (4 from 0). A log is calibrated; then
the machine as calibrated goes to 80 poses that were not measured, and its error is compared with
the one that the result states. A fault is named where its own cause, with its joint, leg or row,
stands in the first sentence or the first finding; or where the first sentence says that the
measurements do not show it.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from measuring import quick

from pteron.calibration import calibrate
from pteron.errors import DataError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from calibration_plants import CASES, FAULTS, WORDS, trial

FINE = 0.5e-3
"""m: what a calibration that states no greater error may be off."""


def judged(case: str, fault: str, seed: int) -> tuple[str, bool, float] | None:
    """Return the grade, whether the cause is read first, and the error over the stated one."""
    sample = trial(case, fault, seed)
    if sample is None:
        return None
    try:
        result = calibrate(sample.robot, sample.given)
    except DataError as error:
        return "refused", any(word in str(error) for word in WORDS.get(fault, ())), 0.0
    lines = [result.verdict.reasons[0], *(finding.text for finding in result.findings[:1])]
    named = any(word in line for word in WORDS.get(fault, ()) for line in lines)
    named |= fault == "none" and not result.findings
    hidden = result.hidden_order.error if result.hidden_order else 0.0
    stated = [max(result.open_errors[name] + hidden, FINE) for name in "xyz"]
    return result.verdict.grade, named, float((sample.errors(result.robot) / stated).max())


def main() -> None:
    """Print a line for each fault and the sums."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    count, first = [*numbers, *(4, 0)[len(numbers) :]][:2]
    seeds = range(first, first + (1 if quick() else count))
    cases = list(CASES)[:2] if quick() else list(CASES)
    total: Counter[str] = Counter()
    print(
        f"{'fault':20}{'calibrations':>13}{'named':>7}  grades; greatest error over the stated one"
    )
    for fault in FAULTS:
        grades: Counter[str] = Counter()
        named, most = 0, 0.0
        for case in cases:
            for seed in seeds:
                answer = judged(case, fault, seed)
                if answer is None:
                    continue
                grade, known, over = answer
                grades[grade] += 1
                named += known
                if not known:
                    wrong = "accused" if fault == "none" else "not named"
                    print(f"  {wrong}: {case}, {fault}, seed {seed}: {grade}")
                if grade not in ("refused", "not trustworthy"):
                    most = max(most, over)
                    total["above"] += over > 1.0
        trials = sum(grades.values())
        sizes = ", ".join(f"{number} {grade}" for grade, number in grades.items())
        print(f"{fault:20}{trials:13}{named:7}  {sizes}; {most:.2f}", flush=True)
        if fault != "none":
            total["faulty"] += trials
            total["named"] += named
    print(
        f"{total['faulty']} calibrations with faults, {total['named']} named first, "
        f"{total['above']} with an error above the stated one"
    )


if __name__ == "__main__":
    main()

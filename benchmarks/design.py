"""A search enlarges the proved cube of the catalog's Quadrupteron by far more than 30 %.

The sliders keep their limits of -300 to 300 mm, and everywhere in the cubes the type-I and type-II
measures are at least 0.1. Once the links' length is free, once their sum is no more than the
catalog's. Cubes are proved by interval arithmetic, before and after, and the best machine is loaded
from its file again. Then a design is evaluated on its own, and a run that is ended after half of
its chunks goes on to the same front. `--quick` searches less.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from measuring import quick

import pteron
from pteron.design import Design, FrontReport, Spec, Task, proved_cube, read_spec, search
from pteron.design.rows import evaluate_design

_FILE = Path(__file__).parent.parent / "examples" / "design_quadrupteron.toml"
_NEEDED = 1.3


def main() -> None:
    """Print the cubes before and after, what changed, and what a design costs."""
    free = read_spec(_FILE)
    held = {"quantity": "links", "most": 1.39}
    kept = Spec.model_validate(
        free.model_dump() | {"requirements": [r.model_dump() for r in free.requirements] + [held]}
    )
    for name, spec in (("links as long as needed", free), ("links no longer in all", kept)):
        compared(name, sized(spec))
    task = Task.from_spec(free)
    values = task.ranges.mean(axis=0).tolist()
    evaluate_design(task, values)
    begin = time.perf_counter()
    for _ in range(10):
        evaluate_design(task, values)
    print(f"one design, its largest cube included: {100 * (time.perf_counter() - begin):.0f} ms")
    resumed(sized(free, population=8, generations=3))


def sized(spec: Spec, population: int = 24, generations: int = 12) -> Spec:
    """Return a search of that size, or a small one."""
    size = (8, 3) if quick() else (population, generations)
    settings = {"population": size[0], "generations": size[1]}
    return spec.model_copy(update={"search": spec.search.model_copy(update=settings)})


def compared(name: str, spec: Spec) -> None:
    """Print the proved cubes, before and after, and what changed."""
    begin = time.perf_counter()
    front = search(spec)
    took = time.perf_counter() - begin
    summary = FrontReport(front)
    before, best = summary.start.cube, summary.selection[0]
    assert before is not None
    assert best.cube is not None
    with TemporaryDirectory() as folder:
        file = Path(folder) / "best.toml"
        file.write_text(summary.robots()["best-cube.toml"], encoding="utf-8")
        again = proved_cube(Design(front.task, pteron.load(file)))
    assert again is not None
    ratio = again.edge / before.edge
    print(f"{name}: {front.evaluated} designs in {took:.0f} s")
    print(f"  proved cube {1e3 * before.edge:.1f} mm, now {1e3 * again.edge:.1f} mm: {ratio:.2f}")
    for change in best.changes[1:]:
        if not change.what.startswith("mass"):
            print(f"  {change.words}")
    limits = [leg.limits for leg in front.task.robot.legs]
    assert [leg.limits for leg in best.design.robot.legs] == limits
    assert ratio >= _NEEDED


def resumed(spec: Spec) -> None:
    """Print whether a run that lost half of its chunks ends in the same front."""
    with TemporaryDirectory() as folder:
        whole, half = Path(folder) / "whole", Path(folder) / "half"
        first = search(spec, folder=whole)
        shutil.copytree(whole, half)
        chunks = sorted(half.glob("*/0*.parquet"))
        for chunk in chunks[len(chunks) // 2 :]:
            chunk.unlink()
        same = search(spec, folder=half).designs.equals(first.designs)
    print(f"a run that lost half of its {len(chunks)} chunks: {'the same' if same else 'ANOTHER'}")
    assert same


if __name__ == "__main__":
    main()

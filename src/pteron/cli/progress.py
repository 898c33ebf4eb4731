"""How long each stage of long work takes."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

_LEAST = 0.05
"""Time that is not worth a word, s."""


class Times:
    """Passes on what is told of stages, and keeps how long each takes."""

    def __init__(self, tell: Callable[[str, int, int], None]) -> None:
        self._tell = tell
        self._spent: dict[str, float] = {}
        self._stage, self._since = "", perf_counter()

    def __call__(self, name: str, done: int, total: int) -> None:
        """Take a stage's name, and how much of it is done."""
        self._end(name)
        # Some stages tell of themselves as they go on, others when they begin.
        self._stage = "" if done else name
        self._tell(name, done, total)

    def told(self) -> str:
        """Return the stages with their times, in a line."""
        self._end("")
        found = ((name, spent) for name, spent in self._spent.items() if name and spent > _LEAST)
        return f"Time: {', '.join(f'{name.lower()} {spent:.1f} s' for name, spent in found)}"

    def _end(self, name: str) -> None:
        now, stage = perf_counter(), self._stage or name
        self._spent[stage] = self._spent.get(stage, 0.0) + now - self._since
        self._since = now

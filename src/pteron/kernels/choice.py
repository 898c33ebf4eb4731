"""Which executable serves the public functions: `numeric`, and its policy."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from pteron.kernels.c import Compiled, compiler
from pteron.kernels.functions import Columns, bare, program
from pteron.kernels.kernel import Array, Kernel
from pteron.kernels.targets import Selects, columns_of
from pteron.kernels.vm import VirtualMachine
from pteron.manipulator import Manipulator, parameters

__all__ = ["VARIABLE", "Adaptive", "numeric"]

VARIABLE = "PTERON_KERNELS"
"""Environment variable: `vm` keeps the public functions on CasADi's virtual machine."""

_PATIENCE = 0.1
"""Seconds of the virtual machine on one function and layout before C code is asked for."""

_CHUNK = 1 << 15
"""States between two looks at whether the C code is ready."""

_AT_WORK = threading.Semaphore(1)
"""One compilation at a time; who comes meanwhile asks again later."""


def numeric(
    robot: Manipulator, what: str, *, base: Selects | None = None, wrench: bool = False
) -> Kernel:
    """Return what evaluates a function for the public functions, by this policy.

    A first call runs at once, on CasADi's virtual machine: about 1 us a state, nothing to compile.
    Once it has spent 0.1 s on a function of a machine's layout, C code for it is read from the
    cache or, where there is a compiler, compiled in the background: half a second or so that no
    call waits for. From then on calls, and what is left of a large batch, run that code, at some
    tens of nanoseconds a state. It returns the same bits, so that a result does not depend on when
    it was asked for. Nothing is compiled at import. `PTERON_KERNELS=vm` in the environment keeps to
    the virtual machine; `compile` gives a kernel of any target, compiled when asked.
    """
    return _known(robot, what, None if base is None else columns_of(base), wrench)


@lru_cache(maxsize=512)
def _known(robot: Manipulator, what: str, columns: Columns | None, wrench: bool) -> Kernel:
    built = program(robot, what, columns, wrench=wrench, guarded=True)
    fixed = {port.name: parameters(robot) for port in built.inputs if port.name == "parameters"}
    tier = _tier(bare(robot), what, columns, wrench)
    return Adaptive(built.name, built.function, built.inputs, built.outputs, fixed, tier=tier)


class _Tier:
    """The C code of one function and layout, and how long it has been missed."""

    def __init__(self, code: Compiled) -> None:
        self.code = code
        self.ready = False
        self._asked = os.environ.get(VARIABLE) == "vm"
        self._seconds = 0.0

    def missed(self, seconds: float) -> None:
        """Take note that the virtual machine worked so long in its place."""
        self._seconds += seconds
        if self._asked or self._seconds < _PATIENCE or not _AT_WORK.acquire(blocking=False):
            return
        self._asked = True
        if compiler() is None:
            _AT_WORK.release()
            return
        _ = self.code.source  # here, not in the thread: CasADi is not made for two at a time
        threading.Thread(target=self._fetch, name="pteron-compile", daemon=True).start()

    def _fetch(self) -> None:
        try:
            self.code.prepare()
            self.ready = True
        except Exception:
            # A compiler that fails costs speed, not results: the virtual machine goes on. Whoever
            # asks `compile` for target "c" is told.
            pass
        finally:
            _AT_WORK.release()


@lru_cache(maxsize=512)
def _tier(layout: Manipulator, what: str, columns: Columns | None, wrench: bool) -> _Tier:
    """Return what machines of one layout share; their inertial parameters are left out of it."""
    built = program(layout, what, columns, wrench=wrench, guarded=True)
    return _Tier(Compiled(built.name, built.function, built.inputs, built.outputs))


@dataclass(frozen=True)
class Adaptive(VirtualMachine):
    """A kernel of the virtual machine that gives way to C code once that is there."""

    tier: Any = field(default=None, hash=False, compare=False)

    @property
    def _direct(self) -> Callable[..., Any] | None:
        if not self.tier.ready:
            return None
        if "direct" not in self.__dict__:
            self.__dict__["direct"] = self.tier.code.with_fixed(self.fixed)._direct
        direct: Callable[..., Any] | None = self.__dict__["direct"]
        return direct

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        for start in range(0, batch, _CHUNK):
            stop = min(start + _CHUNK, batch)
            part = [value if value.ndim == 1 else value[start:stop] for value in inputs]
            results = [value[start:stop] for value in outputs]
            if self.tier.ready:
                self.tier.code._run(stop - start, part, results)
                continue
            begin = time.perf_counter()
            super()._run(stop - start, part, results)
            self.tier.missed(time.perf_counter() - begin)

"""`numeric`: the kernels of the public functions, on CasADi's virtual machine first, then in C."""

from __future__ import annotations

import atexit
import math
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from numpy.typing import ArrayLike

from pteron.kernels.c import Code, compiler
from pteron.kernels.compilers import end_all
from pteron.kernels.kernel import Array, Kernel, slice_states
from pteron.kernels.program_cache import Program, cached_program
from pteron.kernels.programs import ALIKE, Columns, numeric_program
from pteron.kernels.targets import FIXED, Selects, columns_of
from pteron.kernels.vm import VirtualMachine
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

VARIABLE = "PTERON_KERNELS"
"""Environment variable: `vm` keeps the public functions on CasADi's virtual machine."""

_AT_EXIT = 3.0
"""Seconds that a process waits at its end for a compiler in the background: most take less."""

_AT_WORK = threading.Semaphore(1)
"""Admits one compilation at a time; a caller that cannot acquire it tries again later."""

_LOOK = 0.1
"""Seconds of the virtual machine's work after which the cache is searched for C code."""

_BASIC, _EACH = 0.2, 0.7e-3
"""Seconds that gcc 12 takes for a function, and more for each instruction of it (of functions of
245 to 3038, on one core). When the virtual machine has worked as long, the function is compiled:
the two together take at most twice the time of the better one."""

_WAITING: weakref.WeakSet[SharedCode] = weakref.WeakSet()
"""Functions whose code is being compiled in the background."""


def _begin_in_a_fork() -> None:
    """Reset the compilation semaphore in a forked process, in which its owner does not run."""
    global _AT_WORK
    _AT_WORK = threading.Semaphore(1)
    for tier in list(_WAITING):
        tier.ask_again()
    _WAITING.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_in_a_fork)


def numeric(
    robot: RobotLike, what: str, *, base: Selects | None = None, wrench: bool = False
) -> TieredKernel:
    """Return the kernel that evaluates the function `what` of a machine, compiled when worthwhile.

    A first call runs at once, on CasADi's virtual machine: about 1 us a state, nothing to compile.
    After 0.1 s of work on a function of a machine's layout, C code for it is read from the cache.
    If it is not there and there is a compiler, it is compiled in the background once the virtual
    machine has worked as long as that takes, half a second or a few; no call waits. Later calls,
    and the rest of a large batch, run that code, at some tens of nanoseconds a state. It returns
    the same bits, so that a result does not depend on when it is computed. Nothing is compiled at
    import. A process that ends during a compilation waits for it, three seconds at most, so that
    the next process has the code. With `PTERON_KERNELS=vm` in the environment only the virtual
    machine is used; `compile` returns a kernel of any target, compiled at once.
    """
    columns = None if base is None else columns_of(base)
    # Kernels are kept by machine, not by a name, whose file may change.
    machine = robot if isinstance(robot, Manipulator) else as_manipulator(robot)
    return _cached_kernel(machine, what, columns, wrench, ALIKE.get())


@lru_cache(maxsize=512)
def _cached_kernel(
    robot: Manipulator, what: str, columns: Columns | None, wrench: bool, like: object
) -> TieredKernel:
    """Return the kernel of the function `what` of a machine, cached in this process."""
    kernel = kernel_with_status(robot, what, VirtualMachine, columns, wrench=wrench)
    tier = _tier(numeric_program(robot, what, columns, wrench=wrench, guarded=True))
    if like is not None:
        tier.fetch(at_any_cost=False)
    return TieredKernel(kernel, tier)


def kernel_with_status(
    robot: Manipulator,
    what: str,
    kind: type[Kernel],
    columns: Columns | None = None,
    *,
    wrench: bool = False,
) -> Kernel:
    """Return a kernel with a further output `status`: 1 where the others are valid, else 0."""
    built = numeric_program(robot, what, columns, wrench=wrench, guarded=True)
    fixed = {p.name: FIXED[p.name](robot) for p in built.inputs if p.name in FIXED}
    return kind(built.name, built.function, built.inputs, built.outputs, fixed)


def tiered_kernel(key: tuple[Any, ...], build: Callable[[], Program]) -> TieredKernel:
    """Return the kernel of a program without a machine, cached under a key."""
    built = cached_program(key, build)
    parts = built.name, built.function, built.inputs, built.outputs
    return TieredKernel(VirtualMachine(*parts), _tier_of(Code(*parts)))


@lru_cache(maxsize=512)
def _tier(built: Program) -> SharedCode:
    """Return the compiled code that all machines with this program share."""
    return _tier_of(Code(built.name, built.function, built.inputs, built.outputs))


def _tier_of(code: Code) -> SharedCode:
    """Return C code with the interpreter time after which it is compiled; never if set to "vm"."""
    is_vm = os.environ.get(VARIABLE) == "vm"
    return SharedCode(code, math.inf if is_vm else _BASIC + _EACH * code.instruction_count)


class SharedCode:
    """The C code of one function and layout, and the time that calls have spent without it.

    Parameters
    ----------
    code : Code
        The code.
    patience : float
        Seconds of the virtual machine's work before the code is compiled.
    """

    def __init__(self, code: Code, patience: float) -> None:
        self.code = code
        self.ready = False
        self._patience = patience
        self._spent, self._look = 0.0, _LOOK

    def fetch(self, *, at_any_cost: bool) -> None:
        """Load the C code if it is cached; otherwise compile it if `at_any_cost`.

        A batch of millions of states justifies waiting for the compiler.
        """
        if self.ready or os.environ.get(VARIABLE) == "vm" or compiler() is None:
            return
        if self.code.is_cached():
            self._load()  # at once, whatever is being compiled
        elif at_any_cost:
            taken = _AT_WORK
            with taken:
                self._load()

    def add_interpreter_time(self, seconds: float) -> None:
        """Count interpreter time, s: load cached C code after some, compile it after enough."""
        self._spent += seconds
        if self._spent > self._look:
            self._look = math.inf
            self.fetch(at_any_cost=False)
        taken = _AT_WORK
        if self.ready or self._spent <= self._patience or not taken.acquire(blocking=False):
            return
        worker = threading.Thread(
            target=self._load_and_release, args=(taken,), name="pteron-compile", daemon=True
        )
        try:
            self._spent = -math.inf
            if compiler() is not None:
                _ = self.code.source  # not in the thread: CasADi is not made for two at a time
                _WAITING.add(self)
                worker.start()
                atexit.register(_end, worker)
        except BaseException:  # an interrupt, too: a later call asks again
            self._spent = 0.0
            raise
        finally:
            if worker.ident is None:  # it will not release it
                taken.release()

    def ask_again(self) -> None:
        """Restart the count of interpreter time: the thread that compiled the code is gone."""
        self._spent, self._look = 0.0, _LOOK

    def _load(self) -> None:
        """Load or compile the C module and set `ready`; on failure `ready` stays False."""
        try:
            _ = self.code.module
            self.ready = True
        except Exception:
            # A compiler that fails costs speed, not results: the virtual machine goes on.
            # `compile` with target "c" raises the error.
            pass

    def _load_and_release(self, taken: threading.Semaphore) -> None:
        """Load the C module in a worker thread, then release its semaphore in any case."""
        try:
            self._load()
        finally:
            _WAITING.discard(self)
            taken.release()


def _end(worker: threading.Thread) -> None:
    """Wait some seconds at exit for a compiling thread, then end its compiler."""
    worker.join(_AT_EXIT)
    if worker.is_alive():
        end_all()
        worker.join(_AT_EXIT)


class TieredKernel(VirtualMachine):
    """A kernel that runs on the virtual machine until its C code is ready, then in C.

    Parameters
    ----------
    kernel : Kernel
        The function, its ports and what is fixed.
    tier : Tier
        The C code.
    chunk : int
        Number of states after which it is checked again whether the code is ready.
    """

    def __init__(self, kernel: Kernel, tier: SharedCode, chunk: int = 1 << 15) -> None:
        super().__init__(kernel.name, kernel.function, kernel.ports, kernel.outputs, kernel.fixed)
        self.tier = tier
        self._chunk = chunk

    @property
    def is_compiled(self) -> bool:
        """Whether the kernel's C code is loaded, so that calls run it."""
        return self.tier.ready

    def _evaluate(self, *values: ArrayLike, **fixed: ArrayLike) -> Any:
        """Evaluate by the interpreter until the C code is ready, then by the C code."""
        if not self.tier.ready:
            return self.evaluate_checked(*values, **fixed)
        self.call = self.tier.code.bound(self.fixed, self.evaluate_checked)
        return self.call(*values, **fixed)

    def _evaluate_one_state(self, values: Sequence[Any]) -> Any:
        """Evaluate a single state by the interpreter, and count the time it takes."""
        begin = time.perf_counter()
        outputs = super()._evaluate_one_state(values)
        if outputs is not None:
            self.tier.add_interpreter_time(time.perf_counter() - begin)
        return outputs

    def _run(self, batch: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> None:
        """Fill `outputs` for a batch of states in chunks, in C once its code is ready."""
        for start in range(0, batch, self._chunk):
            stop = min(start + self._chunk, batch)
            part = slice_states(inputs, outputs, start, stop)
            if self.tier.ready:
                self.tier.code.module.run(*part[0], *part[1])
                continue
            begin = time.thread_time()  # of this thread, however busy the computer is
            super()._run(stop - start, *part)
            self.tier.add_interpreter_time(time.thread_time() - begin)

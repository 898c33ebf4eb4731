"""Linear algebra in one thread: the same bits wherever it runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Restrict linear algebra to one thread in this context, so that results agree to the bit.

    Several threads add numbers in another order. Dask's workers use one thread anyway. Without
    threadpoolctl, part of the extra `design`, the number of threads is that of the environment
    (OPENBLAS_NUM_THREADS).
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with threadpool_limits(1):
        yield

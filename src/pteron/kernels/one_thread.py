"""Linear algebra in one thread: the same bits wherever it runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Restrict linear algebra to one thread in this context, so that results agree to the bit.

    Dask's workers do so by themselves. Without threadpoolctl, of the extra `design`, the number of
    threads stays that of the environment (OPENBLAS_NUM_THREADS).
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with threadpool_limits(1):
        yield

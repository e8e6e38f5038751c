"""Linear algebra on one thread: how many threads add up a sum decides how it is rounded."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Pin the linear algebra of NumPy and SciPy to one thread of this process.

    Results are then the same to the bit, whatever the number of cores, jobs or limits set outside.
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> "ThreadpoolController":
    # SciPy brings a library of its own, which is limited only once it is loaded.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()

"""Values of batches that nobody has chosen: made where they are read, by doing those runs again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

# (numbers of runs, of times, of quantities) -> their values.
Make = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class LaterValues(BackendArray):
    """Values (runs, times, quantities) by what makes some of them."""

    def __init__(self, shape: tuple[int, int, int], make: Make) -> None:
        self.shape, self.dtype, self._make = shape, np.dtype(float), make

    def __getitem__(self, key: Any) -> Any:
        """What is read, whole runs at least."""
        support = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._read)

    def _read(self, key: tuple[Any, ...]) -> np.ndarray:
        wanted = [np.atleast_1d(np.arange(n)[k]) for n, k in zip(self.shape, key, strict=True)]
        # Whatever the order that is asked for, each is made once.
        unique = [np.unique(part, return_inverse=True) for part in wanted]
        numbers, places = zip(*unique, strict=True)
        shape = [len(part) for part in numbers]
        made = self._make(*numbers) if all(shape) else np.empty(shape)
        dropped = (0 if isinstance(k, int | np.integer) else slice(None) for k in key)
        return made[np.ix_(*places)][tuple(dropped)]


def later(shape: tuple[int, int, int], make: Make) -> Any:
    """The same as a variable of xarray takes it; all of it is kept once all of it is read."""
    return indexing.MemoryCachedArray(indexing.LazilyIndexedArray(LaterValues(shape, make)))

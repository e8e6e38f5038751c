"""Spaces that runs have left, for the next ones of their kind: packing arguments takes long.

A space belongs to one run at a time, in whichever thread: lists are popped and appended at once.
"""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Space = TypeVar("Space")
# Kinds of runs whose spaces are kept.
MOST_KINDS = 64


class SpareSpaces(Generic[Space]):
    """Spaces that no run holds, by what all runs of a kind share."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, list[Space]] = {}

    def taken(self, kind: Hashable, make: Callable[[], Space]) -> Space:
        """A space of that kind, made if none is left."""
        try:
            return self._kept[kind].pop()
        except (KeyError, IndexError):
            return make()

    def give_back(self, kind: Hashable, space: Space) -> None:
        """Leave a space to the next run."""
        spare = self._kept.get(kind)
        if spare is None:
            if len(self._kept) >= MOST_KINDS:
                self._kept.clear()
            spare = self._kept.setdefault(kind, [])
        spare.append(space)

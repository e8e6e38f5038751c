"""Operations as files hold them: numbers alone, of which only arithmetic passes."""

import numpy as np
import pytest

from vehiclemor.codegen.operations import KINDS, MOST_SIZE, Listing, as_arrays, function, of_arrays

PLACE = {kind: place for place, kind in enumerate(KINDS)}


def written():
    listing = Listing()
    x, p = listing.entry("_x", 3), listing.entry("_constants", 1)
    larger = function("<", x, p)
    function("select", larger, x * -0.25, function("atan2", p, abs(x)))
    return listing.operations


def test_what_is_written_as_arrays_is_read_as_it_was():
    operations = written()
    arrays = as_arrays(operations)
    assert of_arrays(**arrays) == tuple(operations)
    # Places of kinds are what files hold: they stay.
    assert (PLACE["entry"], PLACE["add"], PLACE["<"], PLACE["select"]) == (1, 2, 8, 30)
    assert of_arrays(*(array[:0] for array in arrays.values())) == ()


def changed(name, row, value):
    return lambda arrays: arrays[name].__setitem__(row, value)


def longer(arrays):
    for name, array in arrays.items():
        arrays[name] = np.concatenate([array] * MOST_SIZE)


def replaced(name, change):
    return lambda arrays: arrays.update({name: change(arrays[name])})


WRONG = [
    *(changed("kinds", 2, kind) for kind in (-1, len(KINDS), 10**9)),
    # The operation itself, a later one, none.
    *(changed("arguments", (2, 0), number) for number in (2, 5, -1, 10**9)),
    *(changed("arguments", (0, k), number) for k, number in ((0, 3), (0, -1), (1, -1))),
    *(replaced(name, lambda a: a[:-1]) for name in ("kinds", "arguments", "numbers")),
    *(replaced(name, lambda a: a[None]) for name in ("kinds", "arguments", "numbers")),
    *(replaced(name, lambda a: a.astype(float)) for name in ("kinds", "arguments")),
    replaced("numbers", lambda a: a.astype(int)),
    replaced("arguments", lambda a: a[:, :2]),
    longer,
]


@pytest.mark.parametrize("change", WRONG, ids=range(len(WRONG)))
def test_arrays_of_something_else_are_refused(change):
    arrays = as_arrays(written())
    change(arrays)
    with pytest.raises((ValueError, IndexError)):
        of_arrays(**arrays)

"""A method that does not use this package: outputs as polynomials of the inputs at the same time.

Usage: python outside_method.py FOLDER predictions.nc, with what `vehiclemor dataset` has written.
It needs NumPy, xarray and netCDF4.
"""

import sys
from itertools import combinations_with_replacement

import numpy as np
import xarray as xr

FOLDER, OUT = sys.argv[1:]
DEGREE = 3


def histories(data: xr.Dataset, names: list[str]) -> np.ndarray:
    """Quantities (samples, names) of all runs, one behind the other."""
    return np.transpose([data[name].values for name in names])


def products(u: np.ndarray) -> np.ndarray:
    """Products (samples, terms) of at most so many inputs (samples, inputs)."""
    columns = np.c_[np.ones(len(u)), u].T
    picks = combinations_with_replacement(range(len(columns)), DEGREE)
    return np.transpose([np.prod(columns[list(pick)], axis=0) for pick in picks])


train, test = (
    xr.open_dataset(f"{FOLDER}/{name}.nc", decode_times=False) for name in ("training", "test")
)
bounded = [name for name in train.attrs["outputs"].split() if "bound" in train[name].attrs]
known, new = (histories(data, train.attrs["inputs"].split()) for data in (train, test))
largest = np.maximum(np.abs(known).max(axis=0), 1e-12)
terms = products(known / largest)
found = products(new / largest) @ np.linalg.lstsq(terms, histories(train, bounded), rcond=1e-9)[0]
# It warns of runs whose inputs are larger than in the training.
inside = (np.abs(new) <= largest).all(axis=1)
ends = np.cumsum(test["row_size"].values)[:-1]
trusted = [int(run.all()) for run in np.split(inside, ends)]
predictions = {name: ("sample", column) for name, column in zip(bounded, found.T, strict=True)}
same = {name: test.attrs[name] for name in ("model", "test_set_digest")}
xr.Dataset(
    {**predictions, "trusted": ("run", trusted)}, attrs={**same, "method": "polynomials"}
).to_netcdf(OUT)

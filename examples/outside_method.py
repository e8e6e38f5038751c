"""A method that does not use this package: a stable linear model by least squares (DMDc).

Usage: python outside_method.py FOLDER predictions.nc, with what `vehiclemor dataset` has written.
It needs NumPy, xarray and netCDF4.
"""

import sys

import numpy as np
import xarray as xr

FOLDER, OUT = sys.argv[1:]
train, test = (
    xr.open_dataset(f"{FOLDER}/{name}.nc", decode_times=False) for name in ("training", "test")
)
INPUTS, STATES = (train.attrs[name].split() for name in ("inputs", "states"))
BOUNDED = [name for name in train.attrs["outputs"].split() if "bound" in train[name].attrs]


def runs(data: xr.Dataset, names: list[str]) -> list[np.ndarray]:
    """Histories (samples, names) of each run."""
    columns = np.transpose([data[name].values for name in names])
    return np.split(columns, np.cumsum(data["row_size"].values)[:-1])


def solved(known: list[np.ndarray], wanted: list[np.ndarray]) -> np.ndarray:
    """Least squares over all samples of all runs, with a constant."""
    rows = np.concatenate(known)
    return np.linalg.lstsq(np.c_[rows, np.ones(len(rows))], np.concatenate(wanted), rcond=1e-6)[0]


# From one sample to the next x' = [x u 1] A, outputs y = [x u 1] C.
states, inputs = runs(train, STATES), runs(train, INPUTS)
known = [np.c_[x, u] for x, u in zip(states, inputs, strict=True)]
A = solved([rows[:-1] for rows in known], [x[1:] for x in states])
C = solved(known, runs(train, BOUNDED))
values, vectors = np.linalg.eig(A[: len(STATES)])
values /= np.maximum(np.abs(values), 1.0)
A[: len(STATES)] = (vectors * values @ np.linalg.inv(vectors)).real
largest = np.abs(np.concatenate(inputs)).max(axis=0)
found, trusted = [], []
for x, run in zip(test["initial_state"].values, runs(test, INPUTS), strict=True):
    trusted.append(int((np.abs(run) <= largest).all()))
    for u in run:
        row = np.r_[x, u, 1.0]
        found.append(row @ C)
        x = row @ A  # noqa: PLW2901
columns = dict(zip(BOUNDED, np.transpose(found), strict=True))
predictions = xr.Dataset({name: ("sample", column) for name, column in columns.items()})
predictions["trusted"] = "run", trusted
predictions.attrs = {name: test.attrs[name] for name in ("model", "test_set_digest")}
predictions.assign_attrs(method="linear least squares").to_netcdf(OUT)

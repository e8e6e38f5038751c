"""
A method of another program
===========================

A method in any language can be tested on the inputs that the methods of this package are tested on.
``vm.dataset`` writes the runs, the other program predicts, ``vm.judge`` measures.
"""

# %%
# The other program reads netCDF files and knows nothing of this package. This one fits polynomials
# of the inputs to the outputs, and warns of inputs larger than in its training.
import sys
import tempfile
from itertools import combinations_with_replacement
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import vehiclemor as vm


def histories(data, names):
    return np.transpose([data[name].values for name in names])


def products(u, degree):
    columns = np.c_[np.ones(len(u)), u].T
    picks = combinations_with_replacement(range(len(columns)), degree)
    return np.transpose([np.prod(columns[list(pick)], axis=0) for pick in picks])


def predict(folder, out, degree=3):
    train, test = (
        xr.open_dataset(Path(folder) / f"{name}.nc", decode_times=False)
        for name in ("training", "test")
    )
    bounded = [name for name in train.attrs["outputs"].split() if "bound" in train[name].attrs]
    known, new = (histories(data, train.attrs["inputs"].split()) for data in (train, test))
    largest = np.maximum(np.abs(known).max(axis=0), 1e-12)
    terms = products(known / largest, degree)
    fitted = np.linalg.lstsq(terms, histories(train, bounded), rcond=1e-9)[0]
    predicted = products(new / largest, degree) @ fitted
    inside = (np.abs(new) <= largest).all(axis=1)
    ends = np.cumsum(test["row_size"].values)[:-1]
    trusted = [int(run.all()) for run in np.split(inside, ends)]
    columns = {name: ("sample", column) for name, column in zip(bounded, predicted.T, strict=True)}
    same = {name: test.attrs[name] for name in ("model", "test_set_digest")}
    same["method"] = f"polynomials of degree {degree}"
    xr.Dataset({**columns, "trusted": ("run", trusted)}, attrs=same).to_netcdf(out)


# %%
# The suspension has a test set of random runs with a fixed seed. A score is the largest error over
# all runs, in multiples of the bound; a run above 1 is a miss. On the command line, this script is
# the other program: ``python outside_method.py double_wishbone-dataset predictions.nc``.
if __name__ == "__main__" and sys.argv[1:]:
    predict(*sys.argv[1:])
elif __name__ == "__main__":
    folder = Path(tempfile.mkdtemp())
    data, degrees = vm.dataset("double_wishbone", folder / "data"), range(1, 9)
    rows = []
    for degree in degrees:
        predict(data, folder / f"{degree}.nc", degree)
        rows.append(vm.judge(folder / f"{degree}.nc", data).iloc[0])
    print(f"degree 8: {rows[-1].misses} misses in {rows[-1].runs} runs")
    figure, axis = plt.subplots(figsize=(6.7, 3.4))
    axis.semilogy(degrees, [row.score for row in rows], "o-", label="largest")
    axis.semilogy(degrees, [row.median_score for row in rows], "s-", label="median")
    axis.axhline(1.0, color="0.5", ls="--")
    axis.set(xlabel="degree of the polynomials", ylabel="error / bound")
    axis.legend()
    plt.show()

# %%
# No degree stays within the bounds. From degree 4 on, the polynomials fit the training runs better
# and the test runs worse.

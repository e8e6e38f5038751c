"""Stub."""

import matplotlib.pyplot as plt

from vehiclemor.files import write_whole

KINDS = ("histories", "paths", "errors")


def plot_result(dataset, path=None, kind="histories"):
    figure, axis = plt.subplots()
    for output in dataset["output"].values[:3]:
        y = dataset["outputs"].sel(output=output)
        if "method" in y.dims:
            y = y.transpose("time", "method")
        axis.plot(dataset["time"], y)
    if path is not None:
        write_whole(path, lambda temporary: figure.savefig(temporary))
    return figure

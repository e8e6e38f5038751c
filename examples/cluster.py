"""
A study on a cluster
====================

The runs of a study are independent. Two workers of a local dask cluster share them here. The same
lines work with workers on other machines, and a study that was interrupted resumes.
"""

# %%
# A study file names methods and a grid.
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
from distributed import LocalCluster

import vehiclemor as vm

folder = Path(tempfile.mkdtemp())
study, results = folder / "my_study.toml", folder / "results"
study.write_text("""
title = "How many coordinates does POD need?"
model = "double_wishbone"
training = "nominal"
keep = "metrics"

[grid]
rank = [1, 2, 3, 4, 5]
frequency_factor = [1.0, 1.2, 1.4]

[[methods]]
method = "pod"
""")

# %%
# Anyone who reaches a port of dask can run code as you: keep the ports on ``127.0.0.1``.
if __name__ == "__main__":
    workers = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1"}
    with LocalCluster(**workers, dashboard_address=None) as cluster:
        vm.run_study(study, scheduler=cluster.scheduler_address, results=results)

# %%
# The second call finds all runs stored and computes nothing. The result is an xarray dataset whose
# dimensions are the axes of the study.
if __name__ == "__main__":
    result = vm.run_study(study, results=results)
    error = result["rms_error"].sel(output="toe").squeeze()
    print(error.to_pandas().map("{:.1e}".format))
    figure, axis = plt.subplots(figsize=(6.7, 3.4))
    for factor, column in error.groupby("frequency_factor"):
        axis.semilogy(error["rank"], column.squeeze(), "o-", label=f"{factor:g}")
    axis.set(xlabel="coordinates", ylabel="RMS error of toe (rad)", xticks=error["rank"])
    axis.legend(title="frequency factor")
    plt.show()

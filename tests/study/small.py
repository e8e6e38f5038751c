"""Small studies in files, and how the results of two runs of one are compared."""

from pathlib import Path

import xarray as xr

# Measured, so of no two runs the same.
TIMED = ["seconds", "offline_seconds"]


def small_study(
    folder: Path, text: str, *methods: str, model: str = "double_wishbone", name: str = "small"
) -> Path:
    """Write a study of a model: what the text says, and methods at their defaults."""
    head = f'title = "for the tests"\nmodel = "{model}"\n'
    tail = "".join(f'\n[[methods]]\nmethod = "{method}"\n' for method in methods)
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}.toml"
    path.write_text(head + text + tail)
    return path


def assert_same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Two runs of one study have given the same, but for the times."""
    xr.testing.assert_identical(
        one.drop_vars(TIMED, errors="ignore"), other.drop_vars(TIMED, errors="ignore")
    )

"""Datasets of runs that grow along `run`: netCDF files and Zarr stores, moved when complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import FileError, InputError, one_line
from vehiclemor.files import write_folder, write_whole

if TYPE_CHECKING:
    import xarray as xr

NETCDF, ZARR = ".nc", ".zarr"


def checked_target(path: Path) -> Path:
    """A path that batches can be written to; `InputError` or `FileError` if it is none."""
    if path.suffix not in (NETCDF, ZARR):
        raise InputError(f"path: {path} ends neither in {NETCDF} nor in {ZARR}")
    if path.exists():
        raise FileError(f"{path}: exists already; move it away")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no such folder")
    if path.suffix == ZARR:
        try:
            import zarr  # noqa: F401
        except ImportError:
            raise InputError(
                f"path: {path} needs the package zarr: pip install 'vehiclemor[zarr]'"
            ) from None
    return path


def written(path: Path, parts: Iterator[xr.Dataset]) -> None:
    """Write datasets of consecutive runs as they come; nothing is left of them if one fails."""
    if path.suffix == ZARR:
        _write_zarr(path, parts)
    else:
        write_whole(path, lambda temporary: _write_netcdf(temporary, parts))


def opened(path: Path) -> xr.Dataset:
    """The whole dataset, read where it is asked for."""
    import xarray as xr

    if path.suffix == ZARR:
        return xr.open_zarr(path, chunks=None, consolidated=False)
    return xr.open_dataset(path, engine="netcdf4")


def _write_netcdf(path: Path, parts: Iterator[xr.Dataset]) -> None:
    import netCDF4

    first = next(parts)
    with _blamed(path):
        chunks = {"values": {"chunksizes": first["values"].shape}}
        first.to_netcdf(path, engine="netcdf4", unlimited_dims=["run"], encoding=chunks)
        file = netCDF4.Dataset(path, "a")
    growing = [str(name) for name, own in first.variables.items() if "run" in own.dims]
    try:
        for part in parts:
            end = file.dimensions["run"].size
            for name in growing:
                values = part[name].values
                values = values.astype(object) if values.dtype.kind == "U" else values
                with _blamed(path):
                    file.variables[name][end : end + len(values)] = values
    finally:
        with _blamed(path):
            file.close()


@contextmanager
def _blamed(path: Path) -> Iterator[None]:
    """Turn what the library says when it can't write into one line."""
    try:
        yield
    except RuntimeError as error:
        raise FileError(f"{path}: can't be written ({one_line(error)})") from None


def _write_zarr(path: Path, parts: Iterator[xr.Dataset]) -> None:
    def write(place: Path) -> None:
        for number, part in enumerate(parts):
            further = {"append_dim": "run"} if number else {"mode": "w"}
            # Texts of any length, as those of other chunks may be longer.
            texts = {
                name: v.astype(object) for name, v in part.variables.items() if v.dtype.kind == "U"
            }
            part.assign(texts).to_zarr(place, consolidated=False, **further)  # type: ignore[call-overload]

    write_folder(path, write)

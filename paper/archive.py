"""Pack the stored results of all studies into one archive, ready for a repository with a DOI.

Usage: python paper/archive.py --results DIR --out vehiclemor-results.zip
"""

import argparse
import hashlib
import tempfile
import zipfile
from itertools import repeat
from pathlib import Path

import vehiclemor
from vehiclemor.netcdf_file import read_dataset, write_dataset
from vehiclemor.report.results import frame

README = """vehiclemor {version}: stored results of all studies

studies/*.nc       one dataset a study: errors, histories, seconds, counts, status, with units
in_use.nc          reduced models in use: steps, batches, exports
mesh_sizes.nc      full and reduced truck over the mesh
control.nc          models in control: optimal plans, loops, rollouts
tables/*.csv       the same without histories: a row for each point of a grid
*.json             benchmarks of kernels and loops; the full order beside other tools
ENVIRONMENT.txt    machine and versions of libraries, by study
SHA256SUMS.txt     of every file; check with: sha256sum -c SHA256SUMS.txt

Unpacked, it is a results folder: vehiclemor plot figure-11 --results FOLDER.  Or read a dataset
with xarray: xr.open_dataset("studies/figure-11.nc").  The program that made them: vehiclemor
{version}.  The parameters of the paper were never published: results are of public data.
"""


def compressed(path: Path, target: Path, tables: Path) -> dict[str, str]:
    """Write a dataset and its table; gives what the dataset tells of its making."""
    data = read_dataset(path)
    for variable in data.variables.values():
        numbers = variable.dtype.kind in "fiub" and variable.ndim
        variable.encoding = {"zlib": True, "complevel": 9, "shuffle": True} if numbers else {}
    # With the hash that this package checks before it reads a file.
    write_dataset(data, target)
    if "status" in data and data["status"].ndim:
        frame(data).to_csv(tables / f"{path.stem}.csv", index=False)
    return {key: str(data.attrs[key]) for key in ("machine", "versions") if key in data.attrs}


def main(results: Path, out: Path) -> None:
    """Compress every study, and list what the archive holds."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in ("studies", "tables"):
            (folder / name).mkdir()
        paths = [*sorted((results / "studies").glob("*.nc")), *results.glob("*.nc")]
        targets = [folder / path.relative_to(results) for path in paths]
        made = map(compressed, paths, targets, repeat(folder / "tables"))
        lines = [f"{path.stem}: {told}" for path, told in zip(paths, made, strict=True)]
        for path in sorted(results.glob("*.json")):
            (folder / path.name).write_bytes(path.read_bytes())
        (folder / "ENVIRONMENT.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        version = vehiclemor.__version__
        (folder / "README.txt").write_text(README.format(version=version), encoding="utf-8")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        sums = [
            f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.relative_to(folder)}" for p in files
        ]
        (folder / "SHA256SUMS.txt").write_text("\n".join(sums) + "\n", encoding="utf-8")
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for path in [*files, folder / "SHA256SUMS.txt"]:
                archive.write(path, path.relative_to(folder))
    print(f"written: {out}, {len(files) + 1} files, {out.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    main(arguments.results, arguments.out)

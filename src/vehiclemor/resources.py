"""Where the data files are: inside an installed package, or beside `src` in a checkout."""

from functools import cache
from pathlib import Path

from vehiclemor.exceptions import FileError


@cache
def data_folder() -> Path:
    """Folder with `parameters`, `studies`, `protocols` and all other data; or `FileError`."""
    package = Path(__file__).resolve().parent
    for folder in (package / "data", package.parents[1] / "data"):
        if (folder / "parameters").is_dir():
            return folder
    raise FileError(
        f"the data files are missing: neither {package / 'data'} nor a checkout has them"
    )


def handbook_folder() -> Path:
    """Folder with the handbook: notation, architecture, findings, adding a model or a method."""
    package = Path(__file__).resolve().parent
    installed = package / "handbook"
    return installed if installed.is_dir() else package.parents[1] / "paper" / "handbook"


def data_names(kind: str) -> list[str]:
    """Names (without ending) of the data files of one kind, sorted."""
    return sorted(path.stem for path in (data_folder() / kind).glob("*.toml"))

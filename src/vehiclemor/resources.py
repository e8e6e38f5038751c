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


def data_names(kind: str) -> list[str]:
    """Names (without ending) of the data files of one kind, sorted."""
    return sorted(path.stem for path in (data_folder() / kind).glob("*.toml"))

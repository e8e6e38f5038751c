"""Where a command writes to: checked before anything is computed."""

from collections.abc import Sequence
from pathlib import Path

from vehiclemor.errors import InputError


def picture_file(option: str, given: Sequence[Path], default: str) -> Path:
    """The file that was given, or `default` here, as PNG.

    Raises
    ------
    InputError
        If several were given, or the one can't be written as a picture.
    """
    from vehiclemor.report.figures.theme import FORMATS

    if len(given) > 1:
        raise InputError(f"{option}: one file, not {len(given)}")
    path = given[0] if given else Path(f"{default}.png")
    if path.suffix.removeprefix(".").lower() not in FORMATS:
        raise InputError(f"{option} {path}: a picture is one of {', '.join(FORMATS)}")
    _exists(option, path)
    return path


def page_file(option: str, path: Path) -> Path:
    """The HTML file that was given.

    Raises
    ------
    InputError
        If it has another ending, or can't be written.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{option} {path}: the file ends with .html")
    _exists(option, path)
    return path


def result_file(option: str, path: Path) -> Path:
    """The file that was given; one that stands there must be a result, which is replaced.

    Raises
    ------
    InputError, FileError
        If it has another ending, can't be written, or what stands there is something else.
    """
    from vehiclemor.study.netcdf_file import read_dataset

    there = _exists(option, path)
    if path.suffix.lower() != ".nc":
        raise InputError(f"{option} {path}: the file ends with .nc")
    if there:
        read_dataset(path, "source", "vehiclemor")
    return path


def _exists(option: str, path: Path) -> bool:
    """Whether a file stands there already; `InputError` if none can."""
    try:
        if path.is_dir():
            raise InputError(f"{option} {path}: is a folder, not a file")
        if not path.parent.is_dir():
            raise InputError(f"{option} {path}: the folder {path.parent} does not exist")
        return path.exists()
    except OSError as error:
        raise InputError(f"{option} {path}: can't be written ({error.strerror})") from None

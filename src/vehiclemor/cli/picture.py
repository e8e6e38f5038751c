"""Where a picture goes: a file that was named, or one here that is named after the result."""

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
    from vehiclemor.report.figures.saving import FORMATS

    if len(given) > 1:
        raise InputError(f"{option}: one file, not {len(given)}")
    path = given[0] if given else Path(f"{default}.png")
    if path.suffix.removeprefix(".").lower() not in FORMATS:
        raise InputError(f"{option} {path}: a picture is one of {', '.join(FORMATS)}")
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder, not a file")
    if not path.parent.is_dir():
        raise InputError(f"{option} {path}: the folder {path.parent} does not exist")
    return path

"""Style and files of figures."""

from contextlib import AbstractContextManager
from pathlib import Path

import matplotlib.style
from matplotlib.figure import Figure

from vehiclemor.errors import InputError
from vehiclemor.files import write_whole

FORMATS = ("pdf", "svg", "png")
OWN_STYLE = Path(__file__).with_name("style.mplstyle")
# Without a date and a version, two regenerations give the same bytes.
METADATA: dict[str, dict[str, None]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
}


def styled(style: str = "", dpi: int | None = None) -> AbstractContextManager[None]:
    """The package's style, with a style of Matplotlib (name or file) on top, and dots an inch.

    Raises
    ------
    InputError
        If there is no such style, or the resolution makes no sense.
    """
    if dpi is not None and not 10 <= dpi <= 2400:
        raise InputError(f"dpi {dpi}: from 10 to 2400 dots an inch")
    changes = [OWN_STYLE, *([style] if style else []), {"savefig.dpi": dpi} if dpi else {}]
    context = matplotlib.style.context(changes)
    try:
        with context:
            pass
    except OSError:
        known = ", ".join(matplotlib.style.available)
        raise InputError(f"style {style!r}: neither a file nor one of {known}") from None
    return matplotlib.style.context(changes)


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure whole; its format is the file's suffix.

    Raises
    ------
    InputError, FileError
        If the format is not one of `FORMATS`, or the file can't be written.
    """
    suffix = path.suffix.removeprefix(".").lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: a figure is one of {', '.join(FORMATS)}")
    metadata = METADATA[suffix]
    write_whole(path, lambda part: figure.savefig(part, format=suffix, metadata=metadata))
    return path

"""Errors that a user can mend: each carries one clear line."""

import difflib
import errno
from collections.abc import Iterable
from contextlib import suppress
from textwrap import shorten
from traceback import walk_tb
from typing import Any

# Names of which all are listed where none is near, and characters of their list.
MANY, MOST_LISTED = 40, 450
# What of the system's errors is the machine's doing, whoever has asked for it.
MACHINE_ERRORS = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "ENOMEM", "EMFILE", "ENFILE")
    if hasattr(errno, name)
}
# Characters of a message; of a longer one the middle is left out.
LONGEST = 1000


def printable(text: str) -> str:
    """A text in one line that is not too long, without what would act on a terminal."""
    line = " ".join(text.split())
    if len(line) > LONGEST:
        line = f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)


class VehiclemorError(Exception):
    """Base of all errors that reach a user as one line; exit status 2 if not said otherwise."""

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class InputError(VehiclemorError):
    """A name, value or setting is not one that is allowed."""


class PlugInError(InputError):
    """The code of a plug-in has failed, or gives what is refused.  Exit status 1."""


class FileError(VehiclemorError):
    """A file is missing, unreadable, foreign or can't be written."""


class CorruptError(FileError):
    """A stored result is damaged, or another than expected: it is computed again.

    `reason` is the message without the path.
    """

    def __init__(self, reason: str, path: object = "", mend: str = "") -> None:
        super().__init__(f"{path}: {reason}{mend}" if path else reason)
        self.reason = reason


class MachineError(VehiclemorError):
    """The machine has failed, not the input: no space, no memory, a killed process.

    Never a result: what is lost by it is computed again.  Exit status 1.
    """


class GeometryError(VehiclemorError):
    """A mechanism can't be assembled from its parameters."""


class UnreachableError(VehiclemorError):
    """An input asks for a position that the mechanism can't reach."""


class ConvergenceError(VehiclemorError):
    """An iteration did not converge, or met a value that is not finite.

    `trajectory` is the run as far as it went, with its counts; None if there is none.
    """

    def __init__(self, message: str, trajectory: Any = None) -> None:
        super().__init__(message)
        self.trajectory = trajectory


def machine_reason(error: BaseException) -> str:
    """What has failed, if an exception is the machine's doing; else empty."""
    if isinstance(error, MemoryError):
        return " ".join(f"not enough memory {error}".split())
    if isinstance(error, OSError) and error.errno in MACHINE_ERRORS:
        return f"{error.strerror}"
    return ""


def one_line(error: BaseException) -> str:
    """Kind and text of an error in one line; a plug-in's may have no text."""
    text = ""
    with suppress(Exception):
        text = str(error)
    return printable(f"{type(error).__name__}: {text}").rstrip(": ")


def blame(whose: str, code: Any, error: BaseException) -> VehiclemorError:
    """What to raise for an error of a plug-in's code: one line with file and line.

    `code` is the function, class or object that was used, or the name of a module.
    """
    of = code if isinstance(code, str) else getattr(code, "__module__", type(code).__module__)
    package = of.partition(".")[0]
    if isinstance(error, KeyboardInterrupt):
        raise error
    lines = [
        f" ({frame.f_code.co_filename}:{line})"
        for frame, line in walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__", "").partition(".")[0] == package
    ]
    where = lines[-1] if lines else ""
    if reason := machine_reason(error):
        return MachineError(f"{whose}: {reason}{where}")
    return PlugInError(f"{whose}: {one_line(error)}{where}")


class blamed:  # noqa: N801
    """Turn errors of a plug-in's code into one line that names it, see `blame`.

    Errors of this package pass.
    """

    def __init__(self, whose: str, code: Any) -> None:
        self.of = whose, code

    def __enter__(self) -> None:
        """Nothing: a context of a generator would cost whole calls five times as much."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is not None and not isinstance(error, VehiclemorError):
            raise blame(*self.of, error) from error


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """What is meant: near names, or such as contain it; else all known ones, or how to see them."""
    name, known = name if isinstance(name, str) else "", sorted(set(known))
    near = difflib.get_close_matches(name, known, cutoff=0.7)
    if not near and len(name) > 2:
        longer = [other for other in known if name in other]
        near = difflib.get_close_matches(name, longer, cutoff=0.0)
    if near:
        return f"did you mean {' or '.join(near)}?"
    if len(known) > MANY:
        return f"{len(known)} are known: vehiclemor list, vehiclemor show NAME"
    return f"known: {shorten(', '.join(known), MOST_LISTED, placeholder=' ...') or 'none'}"

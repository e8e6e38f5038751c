"""Objects that show themselves in one line: arrays by their shape, the rest cut short."""

import dataclasses
import reprlib
from collections.abc import Mapping
from typing import Any, ClassVar

# Longest text that is shown of one value.
LONGEST = 60


def shortened(text: str) -> str:
    """A text in one line, cut short."""
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]}..."


class ShortRepr:
    """Base of dataclasses that hold arrays, functions or models."""

    # Attributes that are shown; all fields by default.
    repr_fields: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # A dataclass writes one where a class does not define it itself.
        cls.__repr__ = ShortRepr.__repr__

    def __getstate__(self) -> dict[str, Any]:
        """Fields alone: cached results of runs have addresses, which a copy must not share."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}  # type: ignore[arg-type]

    def __repr__(self) -> str:
        fields = self.repr_fields or [f.name for f in dataclasses.fields(self) if f.repr]  # type: ignore[arg-type]
        texts = (f"{name}={_short(getattr(self, name))}" for name in fields)
        return f"{type(self).__name__}({', '.join(texts)})"


def _short(value: Any) -> str:
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        return f"{type(value).__name__}{shape}"
    if isinstance(value, ShortRepr):
        name = getattr(value, "name", "")
        return f"{type(value).__name__} {name!r}" if name else f"{type(value).__name__}(...)"
    if isinstance(value, Mapping):
        return f"{{{', '.join(map(str, [*value][:4]))}{', ...' if len(value) > 4 else ''}}}"
    if callable(value):
        return getattr(value, "__name__", type(value).__name__)
    return shortened(_CUT.repr(value))


_CUT = reprlib.Repr()
_CUT.maxtuple = _CUT.maxlist = 4
_CUT.maxstring = _CUT.maxother = LONGEST

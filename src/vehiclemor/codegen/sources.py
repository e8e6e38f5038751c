"""Hashes of source text: what is made from other source is never taken for up to date."""

import hashlib
import inspect
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

PACKAGE = Path(__file__).resolve().parents[1]


def source_digest(layers: Sequence[str], files: Sequence[str], components: Sequence[object]) -> str:
    """Hash of layers and files of this package, and of plug-ins.

    Parameters
    ----------
    layers
        Folders of the package, with all that is in them.
    files
        Further files of the package.
    components
        Of a plug-in, all of its top-level package counts.
    """
    paths = [path for layer in layers for path in sorted((PACKAGE / layer).rglob("*.py"))]
    paths += [PACKAGE / name for name in files]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    for component in components:
        for text in _plug_in_source(component):
            digest.update(text)
    return digest.hexdigest()[:16]


def _plug_in_source(thing: object) -> list[bytes]:
    """Source texts of the package, or single file, that a component comes from."""
    module = thing if isinstance(thing, ModuleType) else inspect.getmodule(thing)
    if module is None:
        module = inspect.getmodule(type(thing))
    if module is None or module.__file__ is None:
        return [repr(thing).encode()]
    top = module.__name__.split(".")[0]
    if top == "vehiclemor":
        return []
    origin = getattr(sys.modules.get(top), "__file__", None)
    if origin is None or Path(origin).name != "__init__.py":
        return [Path(module.__file__).read_bytes()]
    return [path.read_bytes() for path in sorted(Path(origin).parent.rglob("*.py"))]

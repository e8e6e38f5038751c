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
    """Source texts of the package, or of the single file with its neighbours, of a component."""
    module = _module_of(thing)
    if module is None or module.__file__ is None:
        return [repr(thing).encode()]
    top = module.__name__.split(".")[0]
    if top == "vehiclemor":
        return []
    folders = list(getattr(sys.modules.get(top), "__path__", ()))
    if folders:
        paths = [path for folder in folders for path in sorted(Path(folder).rglob("*.py"))]
        return [path.read_bytes() for path in paths]
    return [path.read_bytes() for path in sorted(_neighbours(module, set()))]


def _module_of(thing: object) -> ModuleType | None:
    """The module that a component is, or that its functions or its class come from."""
    if isinstance(thing, ModuleType):
        return thing
    for name in ("derive", "fit", "signal"):
        if callable(function := getattr(thing, name, None)):
            return inspect.getmodule(function)
    return inspect.getmodule(thing) or inspect.getmodule(type(thing))


def _neighbours(module: ModuleType, found: set[Path]) -> set[Path]:
    """File of a module, and those in its folder of what it has imported."""
    if module.__file__ is None or Path(module.__file__) in found:
        return found
    found.add(Path(module.__file__))
    for value in list(vars(module).values()):
        other = value if isinstance(value, ModuleType) else inspect.getmodule(value)
        origin = getattr(other, "__file__", None)
        if other is not None and origin and Path(origin).parent == Path(module.__file__).parent:
            _neighbours(other, found)
    return found

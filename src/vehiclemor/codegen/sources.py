"""Digests of source files, of this package and of plug-ins."""

import hashlib
import inspect
import sys
from collections.abc import Sequence
from functools import lru_cache, partial
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from vehiclemor.exceptions import PlugInError
from vehiclemor.files import data_folder

PACKAGE = Path(__file__).resolve().parents[1]


def plug_in_digest(components: Sequence[object]) -> str:
    """Hash of the plug-ins that components come from, as their files are now.

    `PlugInError` if a file differs from what is loaded: results would be those of neither.
    """
    files: set[Path] = set()
    # Components that are defined at a prompt have no file.
    defined_at_prompt = []
    for component in components:
        paths = _plug_in_files(component)
        if paths is None:
            defined_at_prompt.append(repr(component).encode())
        else:
            files.update(paths)
    versions = []
    for path in sorted(files):
        status = path.stat()
        versions.append((str(path), status.st_mtime_ns, status.st_size))
    texts = [_digest_of(tuple(versions)).encode(), *defined_at_prompt]
    return _hash([("", text) for text in texts])


@lru_cache(maxsize=64)
def _digest_of(files: tuple[tuple[str, int, int], ...]) -> str:
    """Hash of files by name, time and size; loaded modules must be as their files are."""
    texts = {name: Path(name).read_bytes() for name, *_ in files}
    for module in list(sys.modules.values()):
        name = getattr(module, "__file__", None)
        if name in texts and not _is_loaded(module, texts[name]):
            raise PlugInError(
                f"{name} has changed since it was loaded: restart Python, or reload the module"
            )
    return _hash([("", text) for text in texts.values()])


def _is_loaded(module: ModuleType, text: bytes) -> bool:
    """Whether the functions of a module are those of a text; pytest, and others, rewrite them."""
    loader = module.__loader__
    if type(loader) is not SourceFileLoader:
        return True
    pending = [loader.source_to_code(text, str(module.__file__))]
    in_text = set()
    while pending:
        code = pending.pop()
        in_text.add(code)
        pending += [part for part in code.co_consts if isinstance(part, CodeType)]
    functions = (f.__code__ for f in vars(module).values() if isinstance(f, FunctionType))
    # Decorators and imports bring functions of other files.
    return all(code in in_text for code in functions if code.co_filename == module.__file__)


def source_digest(layers: Sequence[str], files: Sequence[str] = ()) -> str:
    """Hash of layers of this package, folders with their Python files, and of further files."""
    paths = [path for layer in layers for path in sorted((PACKAGE / layer).rglob("*.py"))]
    paths += [PACKAGE / name for name in files]
    texts = [(path.relative_to(PACKAGE).as_posix(), path.read_bytes()) for path in paths]
    # All derivations of a model depend on its declaration.
    models = sorted((data_folder() / "models").glob("*.toml"))
    texts += [(path.name, path.read_bytes()) for path in models]
    return _hash(texts)


def _hash(texts: Sequence[tuple[str, bytes]]) -> str:
    digest = hashlib.sha256()
    for name, text in texts:
        digest.update(f"{name} {len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()[:16]


def _plug_in_files(thing: object) -> list[Path] | None:
    """Files of the top-level package, or the single one with its neighbours; None without any."""
    module = _module_of(thing)
    # `__main__` has no such attribute at a prompt.
    if module is None or getattr(module, "__file__", None) is None:
        return None
    top = module.__name__.split(".")[0]
    if top == "vehiclemor":
        return []
    folders = list(getattr(sys.modules.get(top), "__path__", ()))
    if folders:
        return [path for folder in folders for path in sorted(Path(folder).rglob("*.py"))]
    return sorted(_neighbours(module, set()))


def _module_of(thing: object) -> ModuleType | None:
    """The module that a component is, or that its functions or its class come from."""
    if isinstance(thing, ModuleType):
        return thing
    for name in ("derive", "fit", "signal"):
        if callable(function := getattr(thing, name, None)):
            # A partial function is one of `functools` by its class.
            while isinstance(function, partial):
                function = function.func
            return inspect.getmodule(function)
    return inspect.getmodule(thing) or inspect.getmodule(type(thing))


def _neighbours(module: ModuleType, files: set[Path]) -> set[Path]:
    """File of a module, and files in its folder that it imports; adds them to the set."""
    if module.__file__ is None or Path(module.__file__) in files:
        return files
    files.add(Path(module.__file__))
    for value in list(vars(module).values()):
        other = value if isinstance(value, ModuleType) else inspect.getmodule(value)
        origin = getattr(other, "__file__", None)
        if other is not None and origin and Path(origin).parent == Path(module.__file__).parent:
            _neighbours(other, files)
    return files

"""Digests of source: what a program says, not how it is written down.

They hold for the syntax tree without comments and docstrings, so an edited comment makes nothing
stale.  Parsing the package takes half a second, so the digest is kept under a hash of the bytes.
"""

import ast
import hashlib
import inspect
import sys
from collections.abc import Sequence
from functools import cache, lru_cache, partial
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from vehiclemor.codegen.cache import from_cache
from vehiclemor.exceptions import PlugInError
from vehiclemor.resources import data_folder

PACKAGE = Path(__file__).resolve().parents[1]
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def plug_in_digest(components: Sequence[object]) -> str:
    """Hash of the plug-ins that components come from, as their files are now.

    `PlugInError` if one says something else than what is loaded: results would be those of neither.
    """
    found = [_plug_in_files(component) for component in components]
    files = sorted({path for paths in found for path in paths or ()})
    stats = [(str(path), path.stat()) for path in files]
    known = tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
    # What was written at a prompt has no file.
    rest = [repr(c).encode() for c, paths in zip(components, found, strict=True) if paths is None]
    return _hash([("", text) for text in (_digest_of(known).encode(), *rest)])


@lru_cache(maxsize=64)
def _digest_of(files: tuple[tuple[str, int, int], ...]) -> str:
    """Hash of what some files mean that are as they were loaded."""
    texts = {name: Path(name).read_bytes() for name, *_ in files}
    for module in list(sys.modules.values()):
        name = getattr(module, "__file__", None)
        if name in texts and not _is_loaded(module, texts[name]):
            raise PlugInError(
                f"{name} has changed since it was loaded: restart Python, or reload the module"
            )
    return _hash([("", _meaning(text)) for text in texts.values()])


def _is_loaded(module: ModuleType, text: bytes) -> bool:
    """Whether the functions of a module are those of a text; pytest, and others, rewrite them."""
    loader = module.__loader__
    if type(loader) is not SourceFileLoader:
        return True
    left = [loader.source_to_code(text, str(module.__file__))]
    written = set()
    while left:
        code = left.pop()
        written.add(code)
        left += [part for part in code.co_consts if isinstance(part, CodeType)]
    functions = (f.__code__ for f in vars(module).values() if isinstance(f, FunctionType))
    # What a decorator gives, and what is imported, is of other files.
    return all(code in written for code in functions if code.co_filename == module.__file__)


def source_digest(layers: Sequence[str], files: Sequence[str] = ()) -> str:
    """Hash of layers of this package, folders with all that is in them, and of further files."""
    paths = [path for layer in layers for path in sorted((PACKAGE / layer).rglob("*.py"))]
    paths += [PACKAGE / name for name in files]
    texts = [(path.relative_to(PACKAGE).as_posix(), path.read_bytes()) for path in paths]
    # What models declare of themselves takes part in all that is derived of them.
    models = sorted((data_folder() / "models").glob("*.toml"))
    texts += [(path.name, path.read_bytes()) for path in models]
    # This file decides what a text means.
    written = _hash([("", Path(__file__).read_bytes()), *texts])
    name = f"sources/source-{written}"
    return from_cache(name, lambda: _hash([(n, _meaning(t)) for n, t in texts]).encode()).decode()


def _hash(texts: Sequence[tuple[str, bytes]]) -> str:
    digest = hashlib.sha256()
    for name, text in texts:
        digest.update(f"{name} {len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()[:16]


# Layers share files.
@cache
def _meaning(text: bytes) -> bytes:
    """Hash of the syntax tree of a text; of what is no Python, the text itself."""
    try:
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
                del node.body[0]
        return hashlib.sha256(_written(tree).encode(errors="surrogatepass")).digest()
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return text


def _written(node: object) -> str:
    """As `ast.dump`, which versions of Python do differently: some leave out what is empty."""
    if isinstance(node, list):
        return f"[{', '.join(map(_written, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    fields = [f"{n}={_written(v)}" for n, v in ast.iter_fields(node) if v is not None and v != []]
    return f"{type(node).__name__}({', '.join(fields)})"


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

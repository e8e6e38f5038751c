"""Compiled kernels on disk, addressed by the content of their source and by versions."""

import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

COMPILER_PACKAGES = ("numba", "llvmlite", "numpy")


def kernel_hash(source: str) -> str:
    """Hash of a linked source, the versions of the compiler and of Python."""
    parts = [source, platform.python_version(), platform.machine()]
    parts += [f"{package} {version(package)}" for package in COMPILER_PACKAGES]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of the kernel cache: $VEHICLEMOR_CACHE, or the user's cache folder.

    Where it can't be written, a temporary folder: then every process compiles for itself.
    """
    import platformdirs

    chosen = os.environ.get("VEHICLEMOR_CACHE")
    folder = Path(chosen) if chosen else platformdirs.user_cache_path("vehiclemor")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        # Nothing that others can write is imported from: a folder of this process alone.
        folder = Path(tempfile.mkdtemp(prefix="vehiclemor-"))
    return folder


def write_whole(path: Path, text: str) -> None:
    """Write a file under a temporary name, then move it into place; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(temporary, path)


def load_module(name: str, source: str) -> ModuleType:
    """Import a linked source from the cache, written there first if it is new.

    The folder's name is the hash of the source and of the compiler's versions, and a file in it is
    not written twice; the compiler keeps its machine code beside it.  So a second process
    compiles nothing, and a changed source can't meet old machine code.
    """
    digest = kernel_hash(source)
    module_name = f"vehiclemor_kernels_{name}_{digest}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    folder = cache_folder() / "kernels" / digest
    path = folder / f"{module_name}.py"
    # A damaged file is written again: what runs is always the source at hand.
    if not path.exists() or path.read_text(encoding="utf-8", errors="replace") != source:
        write_whole(path, source)
    specification = importlib.util.spec_from_file_location(module_name, path)
    if specification is None or specification.loader is None:
        raise ImportError(f"can't import {path}")
    module = importlib.util.module_from_spec(specification)
    sys.modules[module_name] = module
    specification.loader.exec_module(module)
    return module

"""`vehiclemor new-plugin`: a package with a model, a maneuver and a method of one's own."""

import re
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path

from vehiclemor.errors import FileError, InputError
from vehiclemor.files import write_folder
from vehiclemor.registry import GROUPS, names
from vehiclemor.resources import data_folder, data_names, handbook_folder

# A package that works as it stands: its name is replaced by the new one wherever it is written.
TEMPLATE = "quarter_car"
NAME = re.compile(r"[a-z]([a-z0-9_]{0,38}[a-z0-9])?")


def new_plugin(name: str, *, out: Path | None = None) -> None:
    """Write a package of your own to begin with: a model, a maneuver, a method, studies, tests.

    Parameters
    ----------
    name
        Of the package and its model; its maneuver is NAME_road, its method NAME_modes.
    out
        New folder; NAME_plugin here by default.
    """
    _check_name(name)
    folder = Path(f"{name}_plugin") if out is None else out
    try:
        if folder.exists() or folder.is_symlink():
            raise FileError(f"{folder} exists: it is not replaced")
        if not folder.absolute().parent.is_dir():
            raise FileError(f"{folder}: the folder {folder.parent} does not exist")
    except OSError as error:
        raise FileError(f"{folder}: can't be written ({error.strerror})") from None
    write_folder(folder, lambda temporary: _write(temporary, name))
    print(f"written: {folder}, a package that works as it stands; to install and try it:\n")
    print(f"  pip install -e {folder} pytest")
    print(f"  pytest {folder}")
    print(f"  vehiclemor simulate {name} --method {name}_modes --frequency 1.2\n")
    print(f"Step by step: {handbook_folder() / 'my-plug-in.md'}")


def _check_name(name: str) -> None:
    """Raise `InputError` where a name is no package's, or means something else already."""
    if not NAME.fullmatch(name) or iskeyword(name):
        word = re.sub(r"[^a-z0-9]+", "_", name.lower(), flags=re.ASCII).strip("_")
        usable = NAME.fullmatch(word) and not iskeyword(word)
        raise InputError(
            f"{name!r} can't name a Python package: at most 40 small letters, digits and "
            f"underscores, a letter first, no word of Python"
            + (f"; what about {word}?" if usable else "")
        )
    for kind in GROUPS:
        for taken in {name, f"{name}_road", f"{name}_modes"} & set(names(kind)):
            raise InputError(f"{name}: there is a {kind} {taken} already")
    if name in data_names("studies"):
        raise InputError(f"{name}: there is a study {name} already")
    # Without an origin it is any folder that happens to be here.
    if getattr(find_spec(name), "origin", None) is not None:
        raise InputError(f"{name}: there is a Python package {name} already")


def _write(folder: Path, name: str) -> None:
    template = data_folder() / "plugin_template"
    for path in template.rglob("*"):
        if path.suffix in (".py", ".toml"):
            text = path.read_text(encoding="utf-8")
            text = text.replace(TEMPLATE.replace("_", "-"), name.replace("_", "-"))
            place = folder / path.relative_to(template).as_posix().replace(TEMPLATE, name)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text.replace(TEMPLATE, name), encoding="utf-8")

"""Reduced models that are on disk: the user's files, and the ones that ship with the package."""

from pathlib import Path
from typing import Any

from vehiclemor.online.model_file import read
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.registry import choice
from vehiclemor.resources import data_folder


def load(path: Any) -> ReducedOrderModel:
    """A reduced model from the file that its `save` has written; nothing is fitted.

    Raises
    ------
    FileError
        If the file is missing, damaged or something else, or does not fit what is installed.
    """
    return ReducedOrderModel(*read(path))


def rom(model: str) -> ReducedOrderModel:
    """The reduced model of a car or a suspension that ships with the package.

    It is the one that the model's protocol has chosen for unseen inputs, see `compare()`.

    Parameters
    ----------
    model
        Registered name.

    Raises
    ------
    InputError
        If none ships for a model of this name.
    """
    known = {path.stem: path for path in shipped_folder().glob("*.nc")}
    return load(known[choice("model with a reduced one that ships", model, known)])


def shipped_folder() -> Path:
    """Folder of the models that ship, each under the name of the full model."""
    return data_folder() / "reduced"

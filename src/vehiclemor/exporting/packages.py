"""Packages that only some exports need."""

from importlib.util import find_spec

from vehiclemor.errors import InputError


def needed(package: str) -> None:
    """Raise `InputError` if a package that is an extra of this one isn't installed."""
    if find_spec(package) is None:
        raise InputError(f"{package} is not installed: pip install 'vehiclemor[{package}]'")

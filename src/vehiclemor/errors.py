"""Errors that a user can mend: each carries one clear line."""


class VehiclemorError(Exception):
    """Base of all errors that reach a user as one line and exit status 2."""


class InputError(VehiclemorError):
    """A name, value or setting is not one that is allowed."""


class FileError(VehiclemorError):
    """A file is missing, unreadable, foreign or can't be written."""


class GeometryError(VehiclemorError):
    """A mechanism can't be assembled from its parameters."""


class UnreachableError(VehiclemorError):
    """An input asks for a position that the mechanism can't reach."""


class ConvergenceError(VehiclemorError):
    """An iteration did not converge, or met a value that is not finite."""

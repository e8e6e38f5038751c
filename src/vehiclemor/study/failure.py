"""The rule for failures: a run that fails is a result with a status and a reason."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from vehiclemor.errors import ConvergenceError, InputError, UnreachableError, VehiclemorError

Result = TypeVar("Result")


@dataclass(frozen=True)
class Failure:
    """Why there is no result: a status other than `ok`, and the reason in one line."""

    status: str
    message: str


def attempt(run: Callable[[], Result], whose: str = "") -> Result | Failure:
    """Result of a call, or how it has failed.

    What is wrong with the model or its files is raised: it would fail everywhere.

    Parameters
    ----------
    whose
        Put before the reason of a failure that is not due to what was asked for.
    """
    try:
        return run()
    except UnreachableError as error:
        return Failure("unreachable", _line(error))
    except ConvergenceError as error:
        return Failure("diverged", whose + _line(error))
    except InputError as error:
        return Failure("rejected", _line(error))
    except VehiclemorError:
        raise
    except Exception as error:  # noqa: BLE001 - a plug-in's bug spoils its own cell, not the study
        return Failure("error", f"{whose}{type(error).__name__}: {_line(error)}")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())

"""The rule for failures.

What the equations do is a result: `diverged`, `unreachable`, `rejected`.  An exception of a method
or model is a bug: `error`, tried again by the next run.  What the machine does is no result.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from vehiclemor.exceptions import (
    ConvergenceError,
    InputError,
    MachineError,
    PlugInError,
    UnreachableError,
    VehiclemorError,
    machine_reason,
    one_line,
)

Result = TypeVar("Result")


@dataclass(frozen=True)
class Failure:
    """Why there is no result: a status other than `ok`, and the reason in one line."""

    status: str
    message: str


def attempt(run: Callable[[], Result], whose: str = "") -> Result | Failure:
    """Result of a call, or how it has failed.

    `MachineError` and errors of files pass: they would come up everywhere.  `whose` is put before
    the reason of a failure that is not due to what was asked for.
    """
    try:
        return run()
    except UnreachableError as error:
        return Failure("unreachable", str(error))
    except ConvergenceError as error:
        return Failure("diverged", f"{whose}{error}")
    except PlugInError as error:
        return Failure("error", f"{whose}{error}")
    except InputError as error:
        return Failure("rejected", str(error))
    except (KeyboardInterrupt, VehiclemorError):
        raise
    except BaseException as error:
        if reason := machine_reason(error):
            raise MachineError(reason) from error
        return Failure("error", whose + one_line(error))


def attempt_apart(name: str, failed: dict[str, str], run: Callable[[], Result]) -> list[Result]:
    """The result of a call; none if it or a file of it fails, with the reason in `failed`."""
    try:
        result = attempt(run)
    except MachineError:
        raise
    except VehiclemorError as error:
        result = Failure("error", str(error))
    if isinstance(result, Failure):
        failed[name] = result.message
        return []
    return [result]

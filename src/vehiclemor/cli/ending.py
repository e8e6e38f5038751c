"""How the command line ends: one line for whatever went wrong, and an exit status."""

import io
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cyclopts import CycloptsError, UnknownOptionError

from vehiclemor.errors import MachineError, PlugInError, VehiclemorError, machine_reason

# A bound is missed, where that is asked for; a simulation, cells of a study, a plug-in or the
# machine have failed; wrong input; and what the number of a signal is added to.
MISSED, FAILED, WRONG_INPUT, STOPPED = 1, 1, 2, 128
MEANING = """Exit status: 0 done; 1 a simulation has diverged, cells of a study have the status
error, a plug-in breaks, the machine has failed (no space, no memory, a killed worker), or a bound
is missed and --check asks; 2 wrong input; 130 and 143 stopped by Ctrl-C and by SIGTERM."""
# Seconds until a signal that has been heard by nobody is raised again.
AGAIN = 2.0


def ended(run: Callable[[], int | None]) -> int:
    """Exit status of a call; why it has ended early is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal that can't show a name must not end a study.
            stream.reconfigure(errors="backslashreplace")
    try:
        with _stopped_by_signals():
            return int(run() or 0)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except (MachineError, PlugInError) as error:
        return _said(str(error), FAILED)
    except (CycloptsError, VehiclemorError) as error:
        return _said(str(error) + _known_options(error), WRONG_INPUT)
    except (MemoryError, OSError) as error:
        reason = machine_reason(error)
        return _said(reason or str(error), FAILED if reason else WRONG_INPUT)
    except KeyboardInterrupt as stop:
        text = "stopped; finished cells of a study are stored, run again to resume"
        return _said(text, STOPPED + (stop.args[0] if stop.args else signal.SIGINT))


def _known_options(error: Exception) -> str:
    """Options of the command, where it has none that is like the one that was given."""
    if not isinstance(error, UnknownOptionError) or "Did you mean" in str(error):
        return ""
    names = sorted({argument.name for argument in error.argument_collection})
    return f" Known: {', '.join(names)}" if names else ""


def _said(text: str, status: int) -> int:
    print("vehiclemor: " + " ".join(text.split()), file=sys.stderr)
    return status


class _StopError(KeyboardInterrupt):
    """A signal, with its number: a class of its own, since Python ends otherwise after Ctrl-C."""


@contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does: workers ended, partial files removed."""

    def stop(number: int, _: object) -> None:
        if hasattr(signal, "setitimer"):
            # Libraries in C may drop an exception: it is raised again until somebody has heard it.
            signal.signal(signal.SIGALRM, lambda *_: _heard() or stop(number, None))
            signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
        raise _StopError(number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def _heard() -> bool:
    """Whether the command is ending: what closes workers may take longer, and must not be cut."""
    error = sys.exception()
    while error and not isinstance(error, _StopError):
        error = error.__context__
    return error is not None

"""The application: its commands, and one clear line and an exit status for what goes wrong."""

import io
import signal
import sys
from collections.abc import Callable, Sequence

from cyclopts import App, CycloptsError, Parameter, UnknownOptionError

from vehiclemor import __version__
from vehiclemor.cli.names import cite, list_components, new_plugin, show
from vehiclemor.cli.options import FAILED, strict
from vehiclemor.cli.runs import dataset, export, judge, metrics, plot, simulate
from vehiclemor.cli.studies import compare, convert, figures, report, run, status
from vehiclemor.exceptions import (
    MachineError,
    PlugInError,
    VehiclemorError,
    machine_reason,
    printable,
)
from vehiclemor.registry import unknown

# Wrong input; and what the number of a signal is added to.
WRONG_INPUT, STOPPED = 2, 128
app = App(
    name="vehiclemor",
    version=__version__,
    help="Benchmark suite for model order reduction of multibody vehicle models.",
    default_parameter=Parameter(converter=strict, negative=""),
    help_epilogue="""Exit status: 0 done; 1 a simulation has diverged, runs of a study have the
status error, a plug-in breaks, the machine has failed (no space, no memory, a killed worker), or a
bound is missed and --check asks; 2 wrong input; 130 and 143 stopped by Ctrl-C and by SIGTERM.""",
    # It must reach `ended`, which tells how to resume.
    suppress_keyboard_interrupt=False,
)
OTHERS = (show, simulate, plot, metrics, run, status, compare, figures, report, export, convert)
OTHERS += (dataset, judge, cite)
COMMANDS = {"list": list_components, "new-plugin": new_plugin} | {c.__name__: c for c in OTHERS}
for name, command in COMMANDS.items():
    app.command(command, name=name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; wrong input is one line on standard error and exit status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    return ended(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value")
    )


class _StopError(KeyboardInterrupt):
    """A signal, with its number; after a plain `KeyboardInterrupt` Python would end by SIGINT."""


def ended(run: Callable[[], int | None]) -> int:
    """Exit status of a call; why it has ended early is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal that can't show a name must not end a study.
            stream.reconfigure(errors="backslashreplace")

    def stop(number: int, _: object) -> None:
        raise _StopError(number)

    # SIGTERM ends a command as Ctrl-C does: workers ended, partial files removed.
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        return int(run() or 0)
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except (MachineError, PlugInError) as error:
        text, status = str(error), FAILED
    except (CycloptsError, VehiclemorError) as error:
        text, status = str(error), WRONG_INPUT
        if isinstance(error, UnknownOptionError):
            options = [a.name for a in error.argument_collection if a.name.startswith("--")]
            text = str(unknown("option", error.token.keyword or error.token.value, options))
    except (ImportError, MemoryError, OSError) as error:
        text = machine_reason(error) or str(error)
        # An error of the system has a number; what has none is of a library that can't be loaded.
        wrong_input = isinstance(error, OSError) and error.errno and not machine_reason(error)
        status = WRONG_INPUT if wrong_input else FAILED
    except KeyboardInterrupt as error:
        text = "stopped; finished runs of a study are stored, run again to resume"
        status = STOPPED + (error.args[0] if error.args else signal.SIGINT)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    print(f"vehiclemor: {printable(text)}", file=sys.stderr)
    return status

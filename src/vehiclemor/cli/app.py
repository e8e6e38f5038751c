"""The application: its commands, and one clear line for what is wrong."""

import sys
from collections.abc import Sequence

from cyclopts import App, Parameter

from vehiclemor import __version__
from vehiclemor.cli.ending import MEANING, ended
from vehiclemor.cli.names import cite, list_components, show
from vehiclemor.cli.new_plugin import new_plugin
from vehiclemor.cli.options import strict
from vehiclemor.cli.runs import export, plot, simulate
from vehiclemor.cli.studies import compare, convert, figures, report, run, status
from vehiclemor.resources import handbook_folder

app = App(
    name="vehiclemor",
    version=__version__,
    help="Benchmark suite for model order reduction of multibody vehicle models.\n\n"
    f"Handbook (notation, findings, how to add a model or a method): {handbook_folder()}",
    default_parameter=Parameter(converter=strict, negative=""),
    help_epilogue=MEANING,
    # It must reach `ended`, which tells how to resume.
    suppress_keyboard_interrupt=False,
)
OTHERS = (show, simulate, plot, run, status, compare, figures, report, export, convert, cite)
COMMANDS = {"list": list_components, "new-plugin": new_plugin} | {c.__name__: c for c in OTHERS}
for name, command in COMMANDS.items():
    app.command(command, name=name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; wrong input is one line on standard error and exit status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    return ended(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value")
    )

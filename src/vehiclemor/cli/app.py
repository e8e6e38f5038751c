"""The application: its commands, and one clear line for what is wrong."""

import sys
from collections.abc import Sequence

from cyclopts import App, Parameter

from vehiclemor import __version__
from vehiclemor.cli.cite import cite
from vehiclemor.cli.compare import compare
from vehiclemor.cli.conversion import strict
from vehiclemor.cli.convert import convert
from vehiclemor.cli.ending import ended
from vehiclemor.cli.exit_status import MEANING
from vehiclemor.cli.export import export
from vehiclemor.cli.figures import figures
from vehiclemor.cli.list import list_components
from vehiclemor.cli.new_plugin import new_plugin
from vehiclemor.cli.plot import plot
from vehiclemor.cli.report import report
from vehiclemor.cli.run import run
from vehiclemor.cli.show import show
from vehiclemor.cli.simulate import simulate
from vehiclemor.cli.status import status
from vehiclemor.resources import handbook_folder

app = App(
    name="vehiclemor",
    version=__version__,
    help="Benchmark suite for model order reduction of multibody vehicle models.\n\n"
    f"Handbook (notation, findings, how to add a model or a method): {handbook_folder()}",
    default_parameter=Parameter(converter=strict),
    help_epilogue=MEANING,
    # It must reach `ended`, which tells how to resume.
    suppress_keyboard_interrupt=False,
)
COMMANDS = {
    "list": list_components,
    "show": show,
    "simulate": simulate,
    "plot": plot,
    "run": run,
    "status": status,
    "compare": compare,
    "figures": figures,
    "report": report,
    "export": export,
    "convert": convert,
    "new-plugin": new_plugin,
    "cite": cite,
}
for name, command in COMMANDS.items():
    app.command(command, name=name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; wrong input is one line on standard error and exit status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    return ended(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value")
    )

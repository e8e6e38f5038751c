"""`vehiclemor list`: what is registered."""

import json
import textwrap
from typing import Annotated, Literal

from cyclopts import Parameter

from vehiclemor import api
from vehiclemor.report.printing import width, wrapped

# A longer name has a line of its own.
LONGEST = 30


def list_components(
    what: Literal["models", "methods", "maneuvers", "studies"] | None = None,
    *,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> int:
    """List what is registered.

    Parameters
    ----------
    what
        One kind; all by default.
    json_output
        Print JSON.
    """
    kinds = ("models", "methods", "maneuvers", "studies") if what is None else (what,)
    found = {kind: getattr(api, kind)() for kind in kinds}
    if json_output:
        print(json.dumps(found if what is None else found[what], indent=2))
        return 0
    # A table of rich would take a tenth of the time of this command.
    for kind, entries in found.items():
        print(f"{kind}:")
        column = min(max(map(len, entries)), LONGEST) + 4
        for name, summary in entries.items():
            lines = textwrap.wrap(summary, width() - column) or [""]
            beside = [] if len(name) > LONGEST else [f"  {name}".ljust(column) + lines.pop(0)]
            print("\n".join([*(beside or [f"  {name}"]), *(" " * column + li for li in lines)]))
        print()
    print(wrapped("vehiclemor show NAME says more, show study-schema how to write a study", 0, 2))
    return 0

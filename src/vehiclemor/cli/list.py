"""`vehiclemor list`: what is registered."""

import json
from typing import Annotated, Literal

from cyclopts import Parameter

from vehiclemor import api


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
    for kind, entries in found.items():
        print(f"{kind}:")
        width = max(len(name) for name in entries)
        for name, summary in entries.items():
            print(f"  {name:<{width}}  {summary}")
    return 0

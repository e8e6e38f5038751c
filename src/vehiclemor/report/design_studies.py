"""Studies of design as they were measured: values, fronts, curves; many cars."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from vehiclemor.resources import data_folder

# Contestant beside the reduced models of many cars; file of what they have shown.
FULL = "full order"
KEPT = "design_space.json"


@cache
def design_studies() -> dict[str, Any]:
    """What `paper/design_studies.py` has written into `data/design.json`."""
    return json.loads((data_folder() / "design.json").read_text(encoding="utf-8"))


def design_space(path: Path | None = None) -> dict[str, dict[str, Any]]:
    """Model -> what `paper/design_space.py` has kept, in `data/design_space.json`, if anything.

    `cars` is their number, `rows` has for each run and method scores (errors in parts of their
    bounds), shares in % and times in ms.
    """
    path = path or data_folder() / KEPT
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}

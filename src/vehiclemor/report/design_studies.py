"""Studies of design as they were measured: values, fronts, curves."""

import json
from functools import cache
from typing import Any

from vehiclemor.resources import data_folder


@cache
def design_studies() -> dict[str, Any]:
    """What `paper/design_studies.py` has written into `data/design.json`."""
    return json.loads((data_folder() / "design.json").read_text(encoding="utf-8"))

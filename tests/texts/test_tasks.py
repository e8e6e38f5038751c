"""Tasks beside other tools: the scripts run, and the table tells how long they are."""

import re
import runpy

import numpy as np
import pytest
from fragments import ROOT

FOLDER = ROOT / "paper" / "tasks"
PAGE = ROOT / "paper" / "handbook" / "ten-thousand-maneuvers.md"


def test_lines_of_user_code_are_those_of_the_scripts():
    told = re.findall(r"\[(\d+)\]\(../tasks/(\w+).py\)", PAGE.read_text(encoding="utf-8"))
    paths = {path.stem: path for path in FOLDER.glob("*.py") if path.stem != "maneuvers"}
    # All but the first line, which says what it is, and empty ones.
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    counts = {
        name: len([*filter(str.strip, text.splitlines())]) - 1 for name, text in texts.items()
    }
    assert {name: int(lines) for lines, name in told} == counts


@pytest.mark.parametrize("name", ["step", "step_full", "fresh_input", "fresh_input_full"])
def test_a_task_runs(name, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    found = runpy.run_path(str(FOLDER / f"{name}.py"))
    result = found["run"].outputs if "run" in found else found["state"]
    assert np.isfinite(result).all()

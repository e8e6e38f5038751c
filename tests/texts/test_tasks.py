"""Scripts of tasks and of the design example run, and do what the pages say."""

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


def test_hard_points_of_the_design_are_an_optimum_within_bounds_that_the_path_map_finds():
    design = runpy.run_path(str(ROOT / "examples" / "design.py"))
    full = design["Designer"]("full_order", 2)
    found = {way: design["hard_points"](way, 2) for way in ("full_order", "path_map")}
    np.testing.assert_allclose(found["path_map"], found["full_order"], atol=1e-7)
    place = found["full_order"]
    slope = full.off(place) @ full.slopes(place)
    at = np.sign(place) * (np.abs(place) > design["LARGEST"] * (1.0 - 1e-4))
    assert 0 < np.count_nonzero(at) < len(at)
    assert np.abs(slope[at == 0]).max() < 1e-4 * np.abs(slope).max()
    assert (slope[at != 0] * at[at != 0] < 0.0).all()

"""Large grids: experiments are made when they are asked for, histories have a limit."""

import weakref

import pytest

import vehiclemor as vm
from tests.study.small import small_study
from vehiclemor.errors import FileError
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.plans.grid import expand
from vehiclemor.study.plans.study_file import StudyFile

AMPLITUDES = "amplitude_factor = { first = 0.5, last = 0.9, count = 60 }"


def test_experiments_of_a_grid_are_made_when_they_are_asked_for(monkeypatch):
    made, alive = [], []
    make = Experiment.__init__

    def counted(self, *given, **further):
        made.append(weakref.ref(self))
        make(self, *given, **further)

    monkeypatch.setattr(Experiment, "__init__", counted)
    given = {
        "title": "t",
        "model": "double_wishbone",
        "keep": "metrics",
        "sampling": {
            "plan": "latin_hypercube",
            "count": 60,
            "seed": 1,
            "ranges": {"parameters.tie_rod_inner.z": [-0.1, -0.09]},
        },
        "methods": [{"method": "pod"}, {"method": "full_order"}],
    }
    grid = expand("mine", StudyFile.model_validate(given))
    assert len(grid.unique) == 120
    for number, (key, cell) in enumerate(grid.unique.items()):
        if number % 40 == 0:
            assert cell.key == key
            alive.append(sum(reference() is not None for reference in made))
    assert len(made) >= 240
    assert max(alive) < 10


def test_histories_that_can_not_be_held_are_refused_before_anything_is_run(tmp_path):
    grid = "frequency_factor = { first = 0.7, last = 1.3, count = 600 }"
    path = small_study(tmp_path, f"[grid]\n{grid}\n{AMPLITUDES}\n", "full_order", "pod")
    with pytest.raises(FileError, match='GB, more than 4: give keep = "metrics"'):
        vm.run_study(path, results=tmp_path / "results")
    assert not (tmp_path / "results").exists()

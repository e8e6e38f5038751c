"""Results of the paper's studies, computed once for all tests of the report."""

import pytest

from vehiclemor.study import timing
from vehiclemor.study.run import run_studies

PROTOCOL = """
title = "unseen travels"
model = "double_wishbone"
bounds.spindle_y = { measure = "rms", bound = 7.57e-5 }
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", points = [[1.3, 1.0]] }]
test = [{ maneuver = "sine_travel", points = [[0.9, 1.0], [1.1, 0.8]] }]
methods = [
    { label = "newton", method = "full_order", role = "full order" },
    { label = "fixed basis", method = "fixed_basis", candidates = [{ rank = 3 }] },
]
targets = [{ against = "within bounds", ratio = 2.0 }]
"""


@pytest.fixture(scope="session")
def small_protocol(tmp_path_factory):
    """A study file of a small protocol, `unseen`."""
    folder = tmp_path_factory.mktemp("protocol")
    (folder / "unseen.toml").write_text(PROTOCOL)
    path = folder / "mine.toml"
    path.write_text(f'title = "x"\nstudies = ["{folder / "unseen.toml"}"]\n')
    return path


@pytest.fixture(scope="module", autouse=True)
def few_rounds():
    """Times are measured, but no test asks how well."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "CASE_ROUNDS", 2)
        patch.setattr(timing, "FITS", 1)
        patch.setattr(timing, "PROTOCOL_ROUNDS", 2)
        yield


@pytest.fixture(scope="session")
def results_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    run_studies("paper", folder)
    return folder


@pytest.fixture(scope="session")
def results(results_folder):
    return run_studies("paper", results_folder)

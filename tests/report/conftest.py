"""Results of the paper's studies, computed once for all tests of the report."""

import pytest

from vehiclemor.study import timing
from vehiclemor.study.run import run_studies


@pytest.fixture(scope="module", autouse=True)
def few_rounds():
    """Times are measured, but no test asks how well."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "CASE_ROUNDS", 2)
        patch.setattr(timing, "FITS", 1)
        yield


@pytest.fixture(scope="session")
def results_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    run_studies("paper", folder, jobs=2)
    return folder


@pytest.fixture(scope="session")
def results(results_folder):
    return run_studies("paper", results_folder)

"""One rule for failures, whether a study is a grid or a protocol."""

import json
from dataclasses import replace

import pytest

from tests.study.small import small_study
from vehiclemor.errors import ConvergenceError, FileError, InputError, UnreachableError
from vehiclemor.reduction.methods import fixed_basis
from vehiclemor.study import evaluate, timing
from vehiclemor.study.failure import attempt
from vehiclemor.study.run import run_studies

RAISED = [
    (InputError("asks for too much"), "rejected", "asks for too much"),
    (UnreachableError("too high"), "unreachable", "too high"),
    (ConvergenceError("after 9\niterations"), "diverged", "after 9 iterations"),
    (ZeroDivisionError("in a plug-in"), "error", f"ZeroDivisionError: in a plug-in ({__file__}:"),
    (SystemExit(0), "error", f"SystemExit: 0 ({__file__}:"),
]


@pytest.fixture(params=RAISED, ids=lambda raised: type(raised[0]).__name__)
def raised(request, monkeypatch):
    """Status and message of what every fit of one method raises."""
    error, status, message = request.param

    def broken(*_):
        raise error

    evaluate._KEPT.clear()
    monkeypatch.setattr(fixed_basis, "METHOD", replace(fixed_basis.METHOD, fit=broken))
    monkeypatch.setattr(timing, "PROTOCOL_ROUNDS", 1)
    yield status, message
    evaluate._KEPT.clear()


def test_what_a_fit_raises_is_a_result_in_a_grid(raised, tmp_path):
    path = small_study(tmp_path, "", "full_order", "fixed_basis")
    cells = run_studies(str(path), tmp_path)["small"].squeeze()
    broken, full = cells.sel(label="fixed_basis"), cells.sel(label="full_order")
    status, message = raised
    assert broken["status"].item() == status
    assert message in broken["message"].item()
    assert full["status"].item() == "ok"


def test_what_a_fit_raises_is_a_result_in_a_protocol(raised, tmp_path, protocol_text):
    (tmp_path / "small.toml").write_text(protocol_text)
    path = tmp_path / "mine.toml"
    path.write_text(f'title = "mine"\nstudies = {json.dumps([str(tmp_path / "small.toml")])}\n')
    rows = run_studies(str(path), tmp_path)["small"]
    broken = rows.sel(label="fixed basis")
    assert set(broken["status"].values) == {raised[0]}
    assert all(raised[1] in message for message in broken["message"].values)
    assert set(rows["status"].sel(label="newton 1e-12").values) == {"ok"}


def test_what_is_wrong_with_a_file_ends_the_study():
    def broken():
        raise FileError("no such file")

    with pytest.raises(FileError):
        attempt(broken)

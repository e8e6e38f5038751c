import json

import numpy as np
import pytest

from benchmarks.peers import clock, report


def points(*triples):
    return [{"tolerance": t, "error": e, "seconds": s, "spread": [s, s, s]} for t, e, s in triples]


SCAN = points((1e-2, 1e-4, 1.0), (1e-3, 5e-2, 2.0), (1e-4, 8e-4, 3.0), (1e-5, 2e-5, 4.0))


CHEAPER = points((1e-2, 1e-4, 5.0), (1e-3, 1e-5, 2.0))


@pytest.mark.parametrize(
    ("scan", "target", "tolerance"),
    [
        (SCAN, 1e-3, 1e-4),
        (SCAN, 1e-1, 1e-2),
        (SCAN, 2e-5, 1e-5),
        (CHEAPER, 1e-3, 1e-3),
        (SCAN, 1e-6, None),
        ([], 1.0, None),
    ],
)
def test_the_cheapest_that_reaches_the_target_not_by_luck_is_chosen(scan, target, tolerance):
    assert (report.choose(scan, target) or {}).get("tolerance") == tolerance


def case(**seconds):
    curves = {
        label.replace("_", " "): {"delivers": "states", "points": points((1e-3, 1e-4, s))}
        for label, s in seconds.items()
    }
    about = {"title": "a car", "unit": "m", "targets": [1e-3], "clock": "CPU time", "about": ""}
    return about | {"curves": curves, "missing": {"other": "not installed (No module)"}}


def test_a_peer_that_is_faster_stands_first_and_is_said_so():
    rows = report.rows(case(ours_slow=2e-3, ours=1e-3, peer=4e-4, late=3e-2), 1e-3, "states")
    assert [row[0] for row in rows] == ["peer", "ours", "ours slow", "late"]
    assert [row[3] for row in rows] == ["0.4: FASTER THAN OURS", "1", "2", "30"]
    assert rows[0][1] == "400 us"


def test_a_missing_peer_is_a_row_and_one_that_fails_too(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "failing_peer.py").write_text("def run(case):\n    raise ValueError('no')\n")
    any_case = clock.Case("run", "", "m", (1.0,), None, None, np.zeros(1))
    curves, missing = clock.collected(["no_such_peer", "failing_peer"], "run", any_case)
    assert not curves
    assert missing["no_such_peer"].startswith("not installed")
    assert missing["failing_peer"] == "failed: ValueError: no"


def test_points_are_measured_and_one_that_fails_is_left_out(capsys):
    def make(tolerance):
        if tolerance > 0.5:
            raise ValueError("too loose")
        return lambda: np.full(2, 1.0 + tolerance)

    curve = clock.Curve(make, clock.decades(1.0, 1e-2, 1))
    any_case = clock.Case("run", "", "m", (1.0,), None, None, np.ones(2))
    found = clock.measured({"peer": curve}, any_case)
    np.testing.assert_allclose([p["error"] for p in found["peer"]["points"]], [0.1, 0.01])
    assert all(p["spread"][0] == p["seconds"] > 0.0 for p in found["peer"]["points"])
    assert "1.0e+00: ValueError: too loose" in capsys.readouterr().out
    assert json.loads(json.dumps(found)) == found

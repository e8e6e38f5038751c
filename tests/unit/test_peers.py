import pytest

from benchmarks.peers import report


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

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

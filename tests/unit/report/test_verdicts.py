"""Verdicts: only the published start is judged, and only by times that do not scatter."""

from vehiclemor.report.verdicts import LARGEST_SPREAD, counted, judged, scatter


def test_only_the_published_start_is_judged():
    assert [judged(met) for met in (True, False)] == ["met", "missed"]
    assert [judged(met, "dropped") for met in (True, False)] == ["ours", "ours"]


def test_rounds_that_scatter_are_named_with_the_limit():
    assert scatter({"full": LARGEST_SPREAD, "pod": 0.0}) == ""
    reason = scatter({"full": 0.01, "pod": 1.5 * LARGEST_SPREAD})
    assert "pod 30 %" in reason
    assert "full" not in reason
    # What is unknown is too large.
    assert scatter({"pod": float("nan")})


def test_verdicts_are_counted_in_words():
    text = counted(["met", "missed", "met", "ours", "not_comparable"])
    assert text.startswith("2 met, 1 missed, 1 not comparable, 1 not judged")

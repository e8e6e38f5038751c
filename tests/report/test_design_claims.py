"""Claims about design keep the verdicts of the studies that were measured."""

from collections import Counter

from vehiclemor.report.comparison.rows import OF_DESIGN, design_rows
from vehiclemor.report.published import load_published
from vehiclemor.report.verdicts import MET, MISSED


def test_claims_about_design_keep_their_verdicts_and_figures():
    finds, saves = (design_rows(load_published().claims[name]) for name in OF_DESIGN)
    assert Counter(row.verdict for row in finds) == {MET: 4, MISSED: 15}
    assert Counter(row.verdict for row in saves) == {MET: 1, MISSED: 4}
    values = {row.variant: row.reproduced for row in (*finds, *saves)}
    assert values["cars, independent suspension vehicle: guarded"] == 0.3
    assert values["springs and dampers: slow manifold"] == 46.6255
    for row in (*finds, *saves):
        assert row.verdict == (MET if row.reproduced <= row.bound else MISSED)

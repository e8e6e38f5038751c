"""The example of design: full order and path map find the same hard points, an optimum."""

import runpy

import numpy as np

from tests.texts.markdown import ROOT


def test_hard_points_are_optimal_within_their_bounds_and_the_path_map_finds_them():
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

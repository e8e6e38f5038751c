"""Tables over many cars: what is counted, and that lines are whatever is stored."""

import car_tables
import design_space
import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.report.design_studies import design_space as kept_tables


def measured() -> xr.Dataset:
    """Four cars by two methods: scores of two outputs."""
    scores = np.full((2, 4, 1, 2), 0.5)
    scores[1, :, 0, 1] = [0.5, 2.0, np.inf, 4.0]
    warned = np.zeros((2, 4, 1), dtype=bool)
    warned[1, [0, 2], 0] = True
    data = {
        "score": (("row", "car", "run", "output"), scores),
        "warned": (("row", "car", "run"), warned),
        "seconds_to_make": (("row", "car"), np.full((2, 4), 2e-3)),
        "seconds": (("row", "car", "run"), np.full((2, 4, 1), 1e-3)),
    }
    attributes = {"model": "independent_suspension_vehicle", "kernel_hash": "a", "versions": "b"}
    labels = {"row": ["one", "another | method"], "run": ["trained input"]}
    return xr.Dataset(data, labels, attributes | {"machine": "c"})


def test_misses_are_silent_where_nothing_warns():
    one, another = design_space.table(measured()).to_dict("records")
    assert (one["worst"], one["missed, %"], one["warned, %"]) == (0.5, 0.0, 0.0)
    assert (another["missed, %"], another["silent, %"], another["warned, %"]) == (75.0, 50.0, 50.0)
    assert (another["median score"], another["worst"]) == (3.0, np.inf)
    assert (another["ms a car"], another["ms a run"]) == (2.0, 1.0)


def test_what_is_kept_stands_in_the_table(tmp_path, monkeypatch):
    path = tmp_path / "kept.json"
    design_space.keep(measured(), path)
    design_space.keep(measured().assign_attrs(model="high_fidelity_vehicle"), path)
    monkeypatch.setattr(car_tables, "design_space", lambda: kept_tables(path))
    monkeypatch.setattr(car_tables, "FIGURES", tmp_path)
    text = car_tables.latin_hypercube(tmp_path)
    assert text.count("vehicle, 4 cars:\n\n| run | method | median score |") == 2
    assert "| trained input | another \\| method | 3 | inf | inf | 75 | 50 | 50 | 2 | 1 |\n" in text
    assert "design-space" not in text
    (tmp_path / "design-space-high_fidelity_vehicle.png").touch()
    assert "(../figures/design-space-high_fidelity_vehicle.png)" in car_tables.latin_hypercube(
        tmp_path
    )


def test_draws_over_cars_alone_stand_in_their_table(tmp_path, monkeypatch):
    assert car_tables.drawn(tmp_path) == ""
    row = {"title": "A car: drawn", "drawn_on": "2026-11-22T10", "runs": 299}
    row |= {"method": "m", "misses": 3, "silent": 1, "flagged": 7, "score": 2.25}
    row |= {"ratio_equal": 1.5, "winner": True}
    monkeypatch.setattr(car_tables, "contestants", lambda _: [pd.DataFrame([row])])
    text = car_tables.drawn(tmp_path)
    assert text.startswith("A car, 299 runs drawn on 2026-11-22:\n\n|  | missed | silent |")
    assert text.count("299 runs") == 1
    assert "| m* | 3 | 1 | 7 | 2.2 | 1.50 |\n" in text

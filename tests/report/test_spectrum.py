"""Singular values and energy content: equations 5 to 8 of the paper."""

import numpy as np
import pytest

from vehiclemor.registry import component
from vehiclemor.report.spectrum import spectrum
from vehiclemor.simulation.build import build


@pytest.fixture(scope="module")
def suspension():
    return spectrum(["double_wishbone"]).sel(model="double_wishbone", preset="literal")


@pytest.mark.parametrize("window", [0, 1])
def test_energy_left_out_is_the_residual_of_the_best_subspace(suspension, window):
    # Equation 8, with the snapshots of one control period taken here by hand.
    model, maneuver = build("double_wishbone"), component("maneuver", "sine_travel")
    times = 5.0 * window + np.linspace(0.0, 5.0, 10)
    states = model.simulate(maneuver, times=times).coordinates
    centred = states - states.mean(axis=0)
    correlation = centred.T @ centred
    eigenvalues, vectors = np.linalg.eigh(correlation)
    part = suspension.sel(window=window)
    for rank in (1, 2, 3):
        leading = vectors[:, -rank:]
        residual = np.sum((centred - centred @ leading @ leading.T) ** 2)
        expected = residual / np.sum(centred**2)
        assert float(part["left_out"].sel(mode=rank)) == pytest.approx(expected, rel=1e-6)
        assert float(part["energy"].sel(mode=rank)) == pytest.approx(1.0 - expected, abs=1e-15)
    ratio = np.sqrt(eigenvalues[-2] / eigenvalues[-1])
    assert float(part["singular_value"].sel(mode=2)) == pytest.approx(ratio, rel=1e-9)


def test_models_with_fewer_modes_and_periods_stand_beside_others():
    data = spectrum(["double_wishbone", "high_fidelity_vehicle"])
    assert dict(data.sizes) == {"model": 2, "preset": 2, "window": 100, "mode": 8}
    assert data["rank"].values.tolist() == [3, 1]
    assert data["control_period"].values.tolist() == [5.0, 0.1]
    counts = data["energy"].notnull().any("window").sum("mode").sel(preset="literal")
    assert counts.values.tolist() == [8, 5]

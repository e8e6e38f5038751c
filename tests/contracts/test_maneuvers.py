"""What every registered maneuver keeps."""

import numpy as np
import pytest

from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, names


@pytest.fixture(params=names("maneuver"))
def maneuver(request: pytest.FixtureRequest) -> Maneuver:
    return component("maneuver", request.param)


def test_it_is_registered_by_its_name_and_unperturbed(maneuver: Maneuver) -> None:
    assert component("maneuver", maneuver.name) is maneuver
    assert maneuver.summary
    assert maneuver == maneuver.perturbed()


def test_inputs_are_finite_and_break_points_lie_inside_the_run(maneuver: Maneuver) -> None:
    for factors in ((1.0, 1.0), (0.8, 1.2), (2.0, 0.5)):
        perturbed = maneuver.perturbed(*factors)
        times, points = perturbed.times, perturbed.break_points
        assert len(times) == maneuver.samples
        assert (times[0], times[-1]) == (0.0, maneuver.duration)
        inputs = perturbed.at(times)
        assert inputs.shape == (len(times), len(maneuver.inputs))
        assert np.isfinite(inputs).all()
        # A value depends on its time alone.
        np.testing.assert_array_equal(perturbed.at(times[7:9]), inputs[7:9])
        assert list(points) == sorted(points)
        assert all(0.0 < point < maneuver.duration for point in points)


def test_amplitude_scales_the_inputs(maneuver: Maneuver) -> None:
    assert maneuver.linear_in_amplitude
    times = maneuver.times
    inputs = maneuver.at(times)
    scaled = maneuver.perturbed(amplitude=-1.5).at(times)
    np.testing.assert_allclose(scaled, -1.5 * inputs, rtol=1e-14, atol=1e-16)
    assert not maneuver.perturbed(amplitude=0.0).at(times).any()

"""What every registered maneuver keeps."""

import numpy as np
import pytest

from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import component, names


@pytest.fixture(params=names("maneuver"))
def maneuver(request: pytest.FixtureRequest) -> Maneuver:
    return component("maneuver", request.param)


def test_maneuver_describes_itself(maneuver: Maneuver) -> None:
    assert maneuver.name in names("maneuver")
    assert component("maneuver", maneuver.name) is maneuver
    assert maneuver.summary
    assert "\n" not in maneuver.summary
    assert (maneuver.frequency_factor, maneuver.amplitude_factor) == (1.0, 1.0)


@pytest.mark.parametrize("factors", [(1.0, 1.0), (0.8, 1.2), (2.0, 0.5)])
def test_inputs_are_finite_and_of_the_right_shape(
    maneuver: Maneuver, factors: tuple[float, float]
) -> None:
    perturbed = maneuver.perturbed(*factors)
    times = perturbed.times
    assert len(times) == maneuver.samples
    assert (times[0], times[-1]) == (0.0, maneuver.duration)
    inputs = perturbed.at(times)
    assert inputs.shape == (len(times), len(maneuver.inputs))
    assert np.isfinite(inputs).all()
    # A value depends on its time alone.
    np.testing.assert_array_equal(perturbed.at(times[7:9]), inputs[7:9])


def test_amplitude_scales_the_inputs(maneuver: Maneuver) -> None:
    assert maneuver.linear_in_amplitude
    times = maneuver.times
    inputs = maneuver.at(times)
    scaled = maneuver.perturbed(amplitude=-1.5).at(times)
    np.testing.assert_allclose(scaled, -1.5 * inputs, rtol=1e-14, atol=1e-16)
    assert not maneuver.perturbed(amplitude=0.0).at(times).any()


def test_break_points_lie_inside_the_run(maneuver: Maneuver) -> None:
    for factor in (0.8, 1.0, 2.0):
        points = maneuver.perturbed(frequency=factor).break_points
        assert list(points) == sorted(points)
        assert all(0.0 < point < maneuver.duration for point in points)

"""Sine and cosine of the kernels are accurate in all quadrants."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehiclemor.codegen.kernels import Kernels, kernel_sources
from vehiclemor.codegen.sincos import sincos

# Largest rounding error of the polynomials and of the last addition.
ACCURACY = 1.7e-16


LINES = [
    *(f"_work[{k}] = _x[{k}]" for k in range(8)),
    "sincos_batch(_work, 0)",
    *(
        f"_result[{k}, {column}] = _work[{8 * (1 + column) + k}]"
        for k in range(8)
        for column in (0, 1)
    ),
]
KERNELS = Kernels(kernel_sources("def batch(_x, _work, _result):\n    " + "\n    ".join(LINES)))


def compiled(angles: np.ndarray) -> np.ndarray:
    """Sines and cosines (n, 2) of n angles by the compiled batch, in blocks of eight."""
    blocks = np.zeros((-(-len(angles) // 8), 8))
    blocks.ravel()[: len(angles)] = angles
    pairs = np.full((len(blocks), 8, 2), np.nan)
    for block, pair in zip(blocks, pairs, strict=True):
        KERNELS.call("batch", block, pair)
    return pairs.reshape(-1, 2)[: len(angles)]


def exact(angles: np.ndarray) -> np.ndarray:
    with mp.workdps(40):
        return np.array([[mp.sin(mp.mpf(a)), mp.cos(mp.mpf(a))] for a in angles])


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1.0, 10.0, 1e3, 1e4])
def test_accuracy_against_mpmath(scale: float, rng: np.random.Generator) -> None:
    angles = rng.uniform(-scale, scale, 400)
    for found in (compiled(angles), np.array([sincos(float(a)) for a in angles])):
        with mp.workdps(40):
            assert max(abs(e) for e in (exact(angles) - found).ravel()) < ACCURACY


def test_borders_of_the_quadrants() -> None:
    borders = np.arange(-9, 10) * (np.pi / 4.0)
    angles = np.concatenate([borders, np.nextafter(borders, 99.0), np.nextafter(borders, -99.0)])
    found = compiled(angles)
    np.testing.assert_allclose(found, exact(angles).astype(float), rtol=0, atol=ACCURACY)


def test_small_angles_keep_their_relative_accuracy() -> None:
    angles = np.array([0.0, 1e-300, -1e-20, 1e-12, -3e-9, 1e-5])
    found = compiled(angles)
    np.testing.assert_allclose(found[:, 0], np.sin(angles), rtol=3e-16, atol=0.0)
    np.testing.assert_allclose(found[:, 1], np.cos(angles), rtol=3e-16)


@given(angle=st.floats(-1e4, 1e4))
def test_identities_hold(angle: float) -> None:
    sine, cosine = sincos(angle)
    assert sine * sine + cosine * cosine == pytest.approx(1.0, abs=5e-16)
    assert sincos(-angle) == pytest.approx((-sine, cosine), abs=2 * ACCURACY)
    turned = sincos(angle + np.pi / 2.0)
    rounding = np.spacing(abs(angle) + 2.0)
    assert turned == pytest.approx((cosine, -sine), abs=rounding + 2 * ACCURACY)


def test_lanes_do_not_disturb_each_other_and_infinite_angles_give_no_number() -> None:
    angles = np.array([0.1, np.nan, 0.3, np.inf, 0.5, 0.6, -np.inf, 0.8])
    found, fine = compiled(angles), np.isfinite(angles)
    assert np.isnan(found[~fine]).all()
    np.testing.assert_allclose(found[fine, 0], np.sin(angles[fine]), rtol=3e-16)

"""Random roads after ISO 8608 under four wheels: a family of maneuvers, one road for each seed.

The displacement density is G(n) = G(n0) (n / n0)^-2 from 0.011 to 2.83 cycles/m, n0 = 0.1 cycles/m,
G(n0) the geometric mean of the road's class.  A track is

    z(x) = sum_i sqrt(2 G(n_i) dn) cos(2 pi n_i x + phase_i),   n_i = i dn,   dn = 1 / (500 m),

with random phases, so that it repeats after 500 m.  On an isotropic surface of this density two
tracks at a distance b have the coherence

    g(n) = 2 pi n b K1(2 pi n b)

(cross density over density; K1 is a modified Bessel function): long waves are the same left and
right, short waves are independent.  Isotropy after C. J. Dodds and J. D. Robson, The description of
road surface roughness, J. Sound Vib. 31 (1973), 175-183; the formula is its integral over all waves
of this density.  Right and left phases differ by a wrapped Cauchy distribution, whose mean of
exp(i difference) is g: so both tracks have the density exactly.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vehiclemor.arguments import count, number, within
from vehiclemor.inputs.maneuver import MOST_SEED, Maneuver, family, smooth
from vehiclemor.inputs.steering import ramp
from vehiclemor.registry import choice, component

# Amplitude factors of the classes; nominal is C, of G(n0) = 256e-6 m^3.
CLASSES = {"A": 0.25, "B": 0.5, "C": 1.0, "D": 2.0, "E": 4.0}
DENSITY, REFERENCE = 256e-6, 0.1
# Cycles/m: steps dn, the edges of whose bins are those of the band.
STEP = 1.0 / 500.0
WAVES = np.arange(6, 1416)
# m/s, nominal and bounds of `road`.
SPEED, SPEEDS = 20.0, (1.0, 40.0)
# Distance (m) of left and right wheels, and of front and rear wheels.
TRACK, WHEELBASE = 2.07, 4.5
# Length (s) of the ramp at which the road sets in.
ONSET = 0.5
# Cells of a Taylor series each, and its order: exact to 1e-15 of the shortest wave's height.
CELLS, ORDER = 4096, 17


@dataclass(frozen=True)
class Road:
    """Signal of a road: heights (m) under the wheels FL, FR, RL, RR, and their rates (m/s).

    Or the wheel travel at the front left, and a rack at rest.  Equal ones are one in all processes.
    """

    seed: int
    travel: bool = False

    def __call__(self, times: np.ndarray, frequency: float, amplitude: float) -> np.ndarray:
        """Inputs (n, 8) or (n, 2) at the times (n,) in s."""
        speed = SPEED * frequency
        onset = ramp(times / ONSET, ONSET)[:, :2, None]
        wheels = [tracks(self.seed, speed * times - behind) for behind in (0.0, WHEELBASE)]
        heights, slopes = (np.hstack(parts) for parts in zip(*wheels, strict=True))
        if self.travel:
            return amplitude * onset[:, 0] * heights[:, :1] * [1.0, 0.0]
        rates = onset[:, 0] * speed * slopes + onset[:, 1] * heights
        return amplitude * np.hstack([onset[:, 0] * heights, rates])


def waves(seed: int) -> np.ndarray:
    """Complex amplitudes (waves, 2) in m of the left and the right track at x = 0."""
    from scipy.special import k1

    left, right = np.random.Generator(np.random.PCG64(seed)).random((2, len(WAVES)))
    reach = 2.0 * np.pi * WAVES * STEP * TRACK
    coherence = reach * k1(reach)
    spread = (1.0 - coherence) / (1.0 + coherence)
    apart = 2.0 * np.arctan(spread * np.tan(np.pi * (right - 0.5)))
    phases = np.column_stack([2.0 * np.pi * left, 2.0 * np.pi * left + apart])
    density = DENSITY * (WAVES * STEP / REFERENCE) ** -2
    return np.sqrt(2.0 * density * STEP)[:, None] * np.exp(1j * phases)


@lru_cache(maxsize=32)
def _series(seed: int) -> np.ndarray:
    """Taylor coefficients (order + 1, cells, 2) of both tracks over a cell's length."""
    spectrum = np.zeros((ORDER + 1, CELLS // 2 + 1, 2), dtype=complex)
    term = 0.5 * CELLS * waves(seed)
    for order in range(ORDER + 1):
        spectrum[order, WAVES] = term
        term = term * (2j * np.pi * WAVES / CELLS / (order + 1))[:, None]
    return np.fft.irfft(spectrum, CELLS, axis=1)


def tracks(seed: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights (n, 2) in m of the left and right track at distances (n,) in m, and slopes (n, 2).

    The sum of all waves, as exact as it can be added up: a Taylor series around the nearest cell.
    """
    position = x * STEP * CELLS
    cell = np.rint(position)
    row = cell.astype(np.int64) % CELLS
    # Arrays of one shape multiply ten times as fast as by broadcasting.
    part = np.repeat((position - cell)[:, None], 2, axis=1)
    height, slope = np.zeros((2, len(x), 2))
    for coefficients in _series(seed)[::-1]:
        slope *= part
        slope += height
        height *= part
        height += coefficients.take(row, axis=0)
    return height, slope * (STEP * CELLS)


_heights = tuple(f"road_{wheel}" for wheel in ("FL", "FR", "RL", "RR"))
_roads = Maneuver(
    "road",
    "random road of ISO 8608 class C at 20 m/s, 10 s; road:SEED is another one",
    Road(1),
    (*_heights, *(f"{name}_dot" for name in _heights)),
    duration=10.0,
    samples=1001,
    corners=smooth,
    linear_in_amplitude=True,
)
_travel = replace(
    _roads,
    name="road_travel",
    summary="wheel travel on a random road of ISO 8608 class C at 20 m/s, rack fixed, 10 s",
    signal=Road(1, travel=True),
    inputs=("z", "s0"),
)
roads, road_travel = family(_roads), family(_travel)


def road(road_class: str = "C", seed: int = 1, speed: float = SPEED) -> Maneuver:
    """A random road after ISO 8608 under four wheels, driven at a constant speed.

    Parameters
    ----------
    road_class, seed, speed
        A (smooth) to E (very rough); 0 to 999999, each gives another road; 1 to 40 m/s.
    """
    amplitude = CLASSES[choice("road class", road_class, CLASSES)]
    frequency = within("speed", number("speed", speed), SPEEDS, " m/s") / SPEED
    seed = count("seed of road", seed, least=0, most=MOST_SEED)
    return component("maneuver", f"road:{seed}").perturbed(frequency, amplitude)

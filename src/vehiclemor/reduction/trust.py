"""What a reduced model knows: how far a run goes in the ranges that it has been made for."""

from collections.abc import Sequence

import numpy as np

from vehiclemor.simulation.trajectory import Trust


def trust_of(times: np.ndarray, used: np.ndarray, names: Sequence[str]) -> Trust:
    """Trust of a run, from how much it uses of the ranges that its model knows.

    Parameters
    ----------
    times
        Output times (samples,) in s.
    used
        Sizes (samples, ranges), 1 at the edge of what is known; what is no number is beyond it.
    names
        Of the ranges.
    """
    used = np.abs(used)
    beyond = np.flatnonzero(~(used <= 1.0).all(axis=1))
    indicator = float(np.fmax.reduce(used, axis=None, initial=0.0))
    if not len(beyond):
        return Trust(indicator)
    first = beyond[0]
    name = names[int(np.argmin(used[first] <= 1.0))]
    reason = f"{name} is beyond its known range, in the run up to {indicator:.3g} times"
    return Trust(indicator, float(times[first]), reason)

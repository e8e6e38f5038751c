"""Error measures of a trajectory against the full-order solution of the same input."""

import numpy as np


def rms(error: np.ndarray) -> np.ndarray:
    """Root mean square over the samples: (samples, k) -> (k,)."""
    return np.sqrt(np.mean(np.square(error), axis=0))


def max_abs(error: np.ndarray) -> np.ndarray:
    """Largest absolute value over the samples: (samples, k) -> (k,)."""
    return np.abs(error).max(axis=0)


def signal_range(signal: np.ndarray) -> np.ndarray:
    """Largest minus smallest value over the samples: (samples, k) -> (k,)."""
    return signal.max(axis=0) - signal.min(axis=0)

"""Error estimates made honest: factors from validation runs that cover all but a few errors.

Split conformal prediction: if the runs to come are drawn as the validation runs were, the error of
an output is at most its estimate in `LEVEL` of them, whatever the estimate is worth; a poor one is
only less sharp.  A. Angelopoulos, S. Bates, Found. Trends Mach. Learn. 16 (2023), 494-591.
"""

import numpy as np

LEVEL = 0.95


def calibrate(raw: np.ndarray, errors: np.ndarray, level: float = LEVEL) -> np.ndarray:
    """Factors (outputs,) on raw estimates: of errors over estimates the quantile of finite samples.

    Parameters
    ----------
    raw, errors
        Estimates and true errors (runs, outputs), not negative.  A run without an estimate counts
        for nothing.
    level
        Share of the errors that shall be covered.  Too few runs can't promise it: the factor is
        infinite then.
    """
    ratios = np.divide(errors, raw, out=np.full(np.shape(raw), np.inf), where=np.asarray(raw) > 0.0)
    ratios[np.asarray(errors) == 0.0] = 0.0
    ratios[np.isnan(raw) | np.isnan(errors)] = np.nan
    factors = np.full(ratios.shape[1], np.inf)
    for i, column in enumerate(ratios.T):
        known = np.sort(column[~np.isnan(column)])
        # The next error is equally likely to come anywhere among these.
        place = int(np.ceil((len(known) + 1) * level - 1e-9))
        if place <= len(known):
            factors[i] = known[place - 1]
    return factors


def estimated(raw: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Estimated errors (runs, outputs) that cover the true ones at the level of the factors.

    Where a factor is infinite there are none.
    """
    return raw * np.where(np.isfinite(factors), factors, np.nan)


def covered(estimates: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Share (outputs,) of the runs with an estimate whose error is at most that."""
    known = ~(np.isnan(estimates) | np.isnan(errors))
    return (known & (errors <= estimates)).sum(axis=0) / np.maximum(known.sum(axis=0), 1)

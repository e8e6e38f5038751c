"""Rates of failure that a number of runs proves."""

# Confidence of the bounds.
CONFIDENCE = 0.95


def upper_bound(misses: int, runs: int) -> float:
    """Rate of misses that so many in so many runs exclude at 95 % (C. Clopper, E. Pearson, 1934).

    The one-sided exact bound: without a miss in 299 runs it is below 1 %.
    """
    from scipy.stats import binomtest

    if runs == 0:
        return 1.0
    test = binomtest(misses, runs, alternative="less")
    return float(test.proportion_ci(CONFIDENCE, method="exact").high)

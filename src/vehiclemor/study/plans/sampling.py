"""Points of a sampling plan: spread over ranges, the same wherever the seed is the same."""

import numpy as np

from vehiclemor.study.plans.study_file import Sampling


def sampled(plan: Sampling) -> dict[str, list[float]]:
    """Name of a range -> its values (count,) at the points of a plan.

    A Latin hypercube has one point in each of `count` slices of every range (M. McKay, R. Beckman,
    W. Conover, Technometrics 21 (1979), 239-245).  Sobol points are scrambled (A. Owen, J.
    Complexity 14 (1998), 466-489).
    """
    from scipy.stats import qmc

    generator = np.random.default_rng(plan.seed)
    if plan.plan == "sobol":
        points = qmc.Sobol(len(plan.ranges), rng=generator).random(plan.count)
    else:
        points = qmc.LatinHypercube(len(plan.ranges), rng=generator).random(plan.count)
    low, high = np.array(list(plan.ranges.values())).T
    values = low + (high - low) * points
    return {name: values[:, j].tolist() for j, name in enumerate(plan.ranges)}

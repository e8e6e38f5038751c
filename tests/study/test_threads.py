"""The threads of the linear algebra, which jobs and other libraries set, change no result."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import vehiclemor as vm
from vehiclemor.study.evaluate import one_thread


def threads() -> set[int]:
    return {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}


def test_threads_are_as_before_outside():
    with threadpool_limits(2, user_api="blas"):
        with one_thread():
            assert threads() == {1}
        assert threads() == {2}


SET = {"training": "set", "training_set": [(1.0, 1.0), (1.2, 0.8), (0.8, 1.2)]}
FITS = [
    ("independent_suspension_vehicle", "slow_manifold", {}),
    ("high_fidelity_vehicle", "two_track", SET),
]


@pytest.mark.parametrize(("model", "method", "training"), FITS, ids=lambda value: str(value)[:13])
def test_the_number_of_threads_changes_no_bit(model, method, training):
    outputs = []
    for number in (1, 2):
        with threadpool_limits(number, user_api="blas"):
            data = vm.simulate(model, method, **training)
        outputs.append(data["outputs"].values)
    np.testing.assert_array_equal(*outputs)

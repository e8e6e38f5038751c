"""The threads of the linear algebra, which jobs and other libraries set, change no result."""

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

import vehiclemor as vm
from vehiclemor.simulation.run_timer import one_thread


def threads() -> set[int]:
    return {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}


def test_the_number_of_threads_changes_no_bit():
    outputs = []
    for number in (1, 2):
        with threadpool_limits(number, user_api="blas"):
            data = vm.simulate("independent_suspension_vehicle", "slow_manifold")
            with one_thread():
                assert threads() == {1}
            assert threads() == {number}
        outputs.append(data["outputs"].values)
    np.testing.assert_array_equal(*outputs)

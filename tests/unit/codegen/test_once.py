"""Machine code stays where its address points to, also where threads ask for it together."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from vehiclemor.codegen.cache import once
from vehiclemor.codegen.kernels import Kernels, kernel_sources

THREADS = 8


def test_what_threads_ask_for_together_is_made_once():
    made, gate = [], threading.Barrier(THREADS)

    @once
    def thing(name: str) -> object:
        time.sleep(0.05)
        made.append(name)
        return object()

    def ask(_: int) -> object:
        gate.wait()
        return thing("a")

    with ThreadPoolExecutor(THREADS) as pool:
        found = set(pool.map(ask, range(THREADS)))
    assert made == ["a"]
    assert len(found) == 1


def test_what_could_not_be_made_is_tried_again():
    tries = []

    @once
    def thing() -> int:
        tries.append(1)
        if len(tries) == 1:
            raise OSError
        return 7

    with pytest.raises(OSError):  # noqa: PT011 - raised above
        thing()
    assert (thing(), thing(), len(tries)) == (7, 7, 2)


def test_threads_share_the_machine_code_of_a_kernel():
    # A text of its own, so that nobody has loaded it before.
    text = "def shared(_x, _work, _result):\n    _result[0] = 17.25*_x[0]\n"
    kernels, gate = Kernels(kernel_sources(text)), threading.Barrier(THREADS)

    def address(_: int) -> int:
        gate.wait()
        return kernels.address("shared")

    with ThreadPoolExecutor(THREADS) as pool:
        assert len(set(pool.map(address, range(THREADS)))) == 1
    result = np.empty(1)
    kernels.call("shared", np.array([2.0]), result)
    assert result[0] == 34.5

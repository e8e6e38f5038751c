"""Loops: ordinary functions with declared arguments, compiled together and called by address."""

from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import NumbaError

from tests.unit.kernels import kernel
from vehiclemor.codegen import loop_types
from vehiclemor.codegen import loops as module
from vehiclemor.codegen.compiler import compiled_loops
from vehiclemor.codegen.kernels import Kernels, MachineCode
from vehiclemor.codegen.loop_types import Float, Int, IntVector, Matrix, Vector, declared_arguments
from vehiclemor.codegen.loops import Loop, ready


class Pair(NamedTuple):
    """A bundle inside of a bundle."""

    weights: Vector
    share: Float


class Bundle(NamedTuple):
    """Arguments of a loop."""

    rows: Matrix
    pair: Pair
    places: IntVector


ENTRY = """
def entry(bundle: Bundle, factor: Float, shift: Int, result: Vector) -> Int:
    for i in range(len(result)):
        result[i] = shift
        for j in range(bundle.rows.shape[1]):
            result[i] += bundle.pair.share * bundle.rows[i, j] * bundle.pair.weights[j]
        result[i] = changed(result[i], factor)
    return bundle.places[1]


def changed(value, factor):
    return value * factor
"""


def module_of(text: str, name: str = "made_up_loops") -> ModuleType:
    made = ModuleType(name)
    types = (Float, Int, IntVector, Matrix, Vector, Bundle)
    names = ("Float", "Int", "IntVector", "Matrix", "Vector", "Bundle")
    vars(made).update(zip(names, types, strict=True))
    for helper in ("vector", "matrix", "call_kernel"):
        setattr(made, helper, getattr(loop_types, helper))
    exec(text, vars(made))  # noqa: S102 - the text of a test
    return made


def compiled(*texts: str, name: str = "entry") -> Loop:
    modules = [module_of(text, f"made_up_{k}") for k, text in enumerate(texts)]
    code = MachineCode(compiled_loops(modules, [name]))
    function = next(vars(m)[name] for m in modules if name in vars(m))
    return Loop(name, declared_arguments(function), code)


@pytest.fixture(scope="module")
def loop() -> Loop:
    return compiled(ENTRY)


@pytest.fixture
def bundle(rng) -> Bundle:
    return Bundle(rng.normal(size=(3, 4)), Pair(rng.normal(size=4), 0.3), np.array([5, -7]))


def test_a_loop_computes_what_its_text_says(loop, bundle):
    plain = module_of(ENTRY).entry
    for given in (bundle, ready(bundle)):
        found, expected = np.empty(3), np.empty(3)
        assert loop(given, 2.5, -3, found) == plain(bundle, 2.5, -3, expected) == -7
        np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_arrays_of_another_kind_are_refused(loop, bundle):
    pair = bundle.pair._replace(weights=np.zeros(4, np.float32))
    wrong = [(bundle, result) for result in (np.zeros(6)[::2], np.zeros((3, 1)), [0.0] * 3)]
    wrong += [(bundle._replace(rows=np.asfortranarray(bundle.rows)), np.zeros(3))]
    wrong += [(bundle._replace(rows=bundle.rows.astype(">f8")), np.zeros(3))]
    wrong += [(bundle._replace(pair=pair), np.zeros(3))]
    for given, result in wrong:
        named = "result" if given is bundle else r"bundle\.(rows|pair\.weights)"
        with pytest.raises(TypeError, match=f"entry: {named}"):
            loop(given, 1.0, 0, result)
    with pytest.raises(TypeError, match=r"\.places"):
        ready(bundle._replace(places=np.zeros(2)))
    with pytest.raises(ValueError, match="zip"):
        loop(bundle, 1.0, 0)


MAKING = """
import numpy as np

def entry(result: Vector) -> Int:
    made = {}
    made[0] = 7.0
    result[1] = made[0]
    return 0
"""


@pytest.mark.parametrize("made", ["np.zeros(3)", "np.empty(3)", "result.copy()", "[0.0, 1.0]"])
def test_a_loop_that_makes_arrays_is_refused(made):
    """Nothing counts references: who makes an array would never free it."""
    with pytest.raises((NumbaError, RuntimeError)):
        compiled(MAKING.format(made))
    result = np.zeros(2)
    compiled(MAKING.format("result"))(result)
    np.testing.assert_array_equal(result, 7.0)


def double(x, u, constants, result):
    result[0] = 2.0 * x[0] + u[0]


def half(x, result):
    result[0] = 0.5 * x[0]


CALL = """
def entry(kernels: IntVector, x: Vector, result: Vector) -> Int:
    call_kernel(kernels, {})
    return 0
"""


@pytest.mark.parametrize(
    ("call", "expected"), [("0, x, x, x, result", 4.5), ("1, x, result", 0.75)]
)
def test_kernels_are_called_by_address_with_as_many_arrays_as_they_take(call, expected):
    kernels = Kernels([kernel(double), kernel(half)])
    addresses = np.array([kernels.address("double"), kernels.address("half")])
    result = np.empty(1)
    compiled(CALL.format(call))(addresses, np.array([1.5]), result)
    assert result == [expected]


@pytest.mark.parametrize("call", ["0, x[::2], x, x, result", "0, x, 1.0, x, result"])
def test_kernels_take_whole_arrays_alone(call):
    with pytest.raises(NumbaError, match="C-contiguous"):
        compiled(CALL.format(call))


def test_another_source_entry_or_compiler_is_another_file(monkeypatch):
    names = []

    def from_cache(name, _):
        names.append(name)
        raise InterruptedError

    def ask(modules=("simulation.path_loops",), entries=("kernel_path",)):
        with pytest.raises(InterruptedError):
            module.loops.__wrapped__(modules, entries)

    monkeypatch.setattr(module, "from_cache", from_cache)
    ask()
    ask()
    ask(entries=("sampled",))
    ask(modules=("simulation.loop_arguments", "simulation.path_loops"))
    for name in ("source_digest", "compiler_identity"):
        monkeypatch.setattr(module, name, lambda *_: "another")
        ask()
    assert names[0] == names[1]
    assert len(set(names)) == len(names) - 1

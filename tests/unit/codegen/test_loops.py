"""Loops count references only where they make arrays."""

import ast
from types import ModuleType

import numpy as np
import pytest
from vehiclemor.codegen.link import linked_source, loops_source

from vehiclemor.codegen import link
from vehiclemor.simulation import explicit_loops, run_loops, system_loops

LOOPS = '''
"""A module of loops."""
import numpy as np

LENGTH = 3
INLINED = ("short",)


def silent(a):
    """Reads and writes what it is given."""
    for k in range(len(a)):
        a[k] = 2.0 * a[k]
    return a[0]


def making(n):
    result = np.zeros(n)
    for k in range(n):
        result[k] = k
    return result


def scratch(n):
    if n > 2:
        return np.empty(n)[0] * 0.0
    return 0.0


def calling_silent(a):
    silent(a)
    silent(a)


def calling(n):
    b = making(n)
    silent(b)
    return b


def calling_it_in_turn(n):
    a = calling(n)
    return a[0]


def short(a):
    b = a[0]
    return b + LENGTH


def longer(a):
    b = a[0]
    return b - LENGTH


def naming_alone(a):
    empty = a[0]
    zeros = a[1]
    return empty + zeros
'''
ALLOCATING = {"making", "scratch", "calling", "calling_it_in_turn"}
SILENT = {"silent", "calling_silent", "short", "longer", "naming_alone"}


def module_of(text: str, folder, name: str) -> ModuleType:
    """A module with its source on disk, where `inspect` reads it."""
    path = folder / f"{name}.py"
    path.write_text(text)
    module = ModuleType(name)
    module.__file__ = str(path)
    exec(compile(text, str(path), "exec"), vars(module))  # noqa: S102 - the text above
    return module


@pytest.fixture
def loops(tmp_path) -> ModuleType:
    return module_of(LOOPS, tmp_path, "made_up_loops")


def decorators(source: str) -> dict[str, dict[str, object]]:
    """Function -> options of its compilation."""
    found = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef):
            (call,) = node.decorator_list
            assert isinstance(call, ast.Call)
            found[node.name] = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
    return found


def test_loops_that_make_no_array_do_not_count_references(loops):
    options = decorators(loops_source([loops], "a test"))
    assert set(options) == ALLOCATING | SILENT
    without = {name for name, given in options.items() if given.get("_nrt") is False}
    assert without == SILENT
    assert not any("_nrt" in options[name] for name in ALLOCATING)
    # All else is as it is for others.
    assert {name for name, given in options.items() if given.get("forceinline")} == {"short"}
    for given in options.values():
        assert given["nogil"]
        assert given["cache"]


def test_a_loop_that_calls_one_of_an_earlier_module_counts_as_it_does(loops, tmp_path):
    later = module_of(
        "def on_top(n):\n    a = calling(n)\n    return a\n\n\n"
        "def beside(a):\n    silent(a)\n    return a[0]\n",
        tmp_path,
        "later_loops",
    )
    options = decorators(loops_source([loops, later], "a test"))
    assert "_nrt" not in options["on_top"]
    assert options["beside"]["_nrt"] is False


def test_linked_loops_count_references_as_ever(loops):
    kernels = "def residual(_q, _work, _result):\n    _result[0] = _q[0]\n"
    text = linked_source(kernels, [loops], {"N": 1}, "a test")
    assert "_nrt" not in text
    assert set(decorators(text)) > ALLOCATING | SILENT


def test_functions_that_allocate_are_found_through_their_callers():
    assert link._allocating(LOOPS) == ALLOCATING | {"empty", "zeros"}
    assert link._allocating("def f(a):\n    return a[0]\n") == {"empty", "zeros"}


def test_whatever_makes_arrays_in_the_packages_loops_is_known():
    """Numpy functions and methods that would allocate, other than those looked for."""
    allowed = {"empty", "zeros"}
    for module in (system_loops, explicit_loops, run_loops):
        for node in ast.walk(ast.parse(link._functions(module))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("np."):
                made = getattr(np, ast.unparse(node.func).removeprefix("np."))
                assert made.__name__ in allowed or isinstance(made, np.ufunc), made
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                assert node.func.attr not in {"copy", "astype", "flatten", "dot"}
            # No products of arrays, no lists.
            assert not isinstance(node, ast.MatMult | ast.List | ast.ListComp)

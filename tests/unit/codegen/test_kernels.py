"""Kernels are compiled one by one when they are first used, and never taken for another's."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vehiclemor.codegen import cache
from vehiclemor.codegen import kernels as module
from vehiclemor.codegen.kernels import Kernels, kernel_sources

TEXT = """
def double(_x, _work, _result):
    _result[0] = 2.0 * _x[0]


def product(_x, _u, _constants, _work, _result):
    _result[0, 0] = _x[0] * _u[1]
    _result[0, 1] = _constants[3]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kernels"


def names(folder: Path) -> list[str]:
    return sorted(path.name.rpartition("-")[0] for path in folder.glob("*"))


def loaded(source) -> int:
    """As in a process of its own."""
    return module._machine.__wrapped__(source)[0]


def test_a_kernel_knows_what_it_wants_of_its_arrays():
    source = kernel_sources(TEXT)["product"]
    assert source.arguments == ("_x", "_u", "_constants", "_result")
    assert source.sizes == (1, 2, 4, 2)
    assert source.dimensions == 2


def test_a_kernel_that_is_not_used_is_not_compiled(folder):
    kernels = Kernels(kernel_sources(TEXT.replace("2.0", "7.0")))
    assert "product" in kernels
    assert names(folder) == []
    result = np.empty(1)
    kernels.call("double", np.array([1.5]), result)
    assert result == [10.5]
    assert names(folder) == ["double"]


def test_another_text_compiler_or_processor_is_another_file(folder, monkeypatch):
    source = kernel_sources(TEXT)["double"]
    loaded(source)
    loaded(source)
    assert names(folder) == ["double"]
    loaded(kernel_sources(TEXT.replace("2.0", "3.0"))["double"])
    assert names(folder) == ["double"] * 2
    for number, function in enumerate(("source_digest", "compiler_identity"), 3):
        with monkeypatch.context() as patch:
            patch.setattr(module, function, lambda *_: "another")
            loaded(source)
        assert names(folder) == ["double"] * number
    loaded(source)
    assert len(names(folder)) == 4


def test_the_identity_of_the_compiler_names_versions_and_processor(monkeypatch):
    import llvmlite.binding as llvm

    identity, real = cache.compiler_identity.__wrapped__, cache.version
    before = identity()
    features = SimpleNamespace(flatten=lambda: "-avx2")
    changes = [(llvm, "get_host_cpu_name", lambda: "z80")]
    changes += [(llvm, "get_host_cpu_features", lambda: features)]
    changes += [
        (cache, "version", lambda n, p=package: "0.0.1" if n == p else real(n))
        for package in cache.COMPILER_PACKAGES
    ]
    for where, name, changed in changes:
        with monkeypatch.context() as patch:
            patch.setattr(where, name, changed)
            assert identity() != before
    assert identity() == before


def test_what_is_missing_has_no_address():
    kernels = Kernels(kernel_sources(TEXT))
    assert "triple" not in kernels
    assert kernels.address("triple") == 0
    _, _, code = module._machine.__wrapped__(kernels.sources["double"])
    with pytest.raises(ImportError, match="triple"):
        code.address("triple")

"""What was derived once is kept on disk, and never taken for that of another source."""

import importlib.util
import json
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from tests.unit import standard_problems
from vehiclemor.codegen import cache
from vehiclemor.codegen import derivation as kept
from vehiclemor.codegen.derivation import Derivation, derived
from vehiclemor.codegen.kernel_text import operation_counts, reference_source
from vehiclemor.multibody import definition
from vehiclemor.symbolic.program import Program

NAME = standard_problems.NAME


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where derivations are kept."""
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    return tmp_path / "derivations"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """One entry for each time that the plug-in model was derived."""
    made, real = [], standard_problems.derive

    def derive() -> Program:
        made.append("derived")
        return real()

    monkeypatch.setattr(standard_problems, "derive", derive)
    return made


def fetch(name: str = NAME, definition: Any = standard_problems) -> Derivation:
    """As in a process of its own, which remembers nothing."""
    kept._read.cache_clear()
    return kept.derivation(name, definition.derive)


def test_a_model_is_derived_once_and_read_back_as_it_was(folder: Path, calls: list) -> None:
    first = fetch()
    assert calls == ["derived"]
    (path,) = folder.iterdir()
    assert path.name.startswith(f"{NAME}_")
    written = path.stat().st_mtime_ns
    second = fetch()
    assert calls == ["derived"]
    assert second == first
    assert second is not first
    # Down to the types: shapes are not lists of lists.
    assert repr(second) == repr(first)
    assert [path.stat().st_mtime_ns for path in folder.iterdir()] == [written]


def test_a_derivation_describes_its_equations(folder: Path) -> None:
    program = standard_problems.derive()
    for made in (fetch(), fetch()):
        assert made.shapes == {
            "derivative": (4,),
            "outputs": (8,),
            "second_order": (2, 3),
            "speeds": (2,),
        }
        assert made.operations == operation_counts(reference_source(program))
        # By hand: rate (target - x) + rate of the target; -sin + torque; growth x^2.
        assert made.operations["derivative"] == {
            "add": 3,
            "multiply": 3,
            "divide": 0,
            "negate": 1,
            "sqrt": 0,
            "trigonometric": 1,
            "power": 0,
            "total": 8,
        }
        assert made.operations["outputs"]["trigonometric"] == 4


def test_the_source_read_back_computes_what_the_model_says(folder: Path, standard) -> None:
    model = standard(rate=3.0, growth=0.5)
    assert [path.name.rpartition("_")[0] for path in folder.iterdir()] == [NAME]
    x, u = np.array([0.3, -0.7, 0.2, 1.1]), np.array([0.4, 0.9, -0.6])
    expected = [0.2, 3.0 * (0.9 + 0.7) - 0.6, 0.4 - np.sin(0.3), 0.5 * 1.1**2]
    np.testing.assert_allclose(model.derivative(x, u), expected, rtol=1e-15)


def test_the_same_process_parses_the_file_once(folder: Path, calls: list) -> None:
    kept._read.cache_clear()
    try:
        first = kept.derivation(NAME, standard_problems.derive)
        assert kept.derivation(NAME, standard_problems.derive) is first
        assert calls == ["derived"]
    finally:
        kept._read.cache_clear()


def emptied(text: str) -> bytes:
    del text
    return b""


def cut(text: str) -> bytes:
    return text[: len(text) // 2].encode()


def without_the_last_character(text: str) -> bytes:
    return text[:-1].encode()


def binary(text: str) -> bytes:
    return b"\xff\xfe\x00" + text.encode()


def with_an_entry(**entries: object):
    def changed(text: str) -> bytes:
        digest, content = text.split("\n")
        return f"{digest}\n{json.dumps(json.loads(content) | entries)}".encode()

    return changed


def without_an_entry(name: str):
    def changed(text: str) -> bytes:
        digest, content = text.split("\n")
        kept = {key: value for key, value in json.loads(content).items() if key != name}
        return f"{digest}\n{json.dumps(kept)}".encode()

    return changed


def replaced(content: object):
    def changed(_text: str) -> bytes:
        return json.dumps(content).encode()

    return changed


def with_another_source(text: str) -> bytes:
    """A disk error inside a string: what follows the hash is JSON as before."""
    assert text.count("_result[0]")
    return text.replace("_result[0]", "_result[1]", 1).encode()


DAMAGES = {
    "empty": emptied,
    "cut": cut,
    "without the last character": without_the_last_character,
    "not text": binary,
    "a list": replaced([]),
    "a number": replaced(7),
    "null": replaced(None),
    "an empty object": replaced({}),
    "no sources": without_an_entry("sources"),
    "no operations": without_an_entry("operations"),
    "an entry that is none of its own": with_an_entry(coordinates=[]),
    "shapes that are a list": with_an_entry(shapes=[]),
    "shapes that are null": with_an_entry(shapes=None),
    "sources that are null": with_an_entry(sources=None),
    "another source": with_another_source,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_is_derived_and_written_again(folder: Path, calls: list, damage) -> None:
    first = fetch()
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(damage(whole.decode()))
    assert path.read_bytes() != whole
    assert fetch() == first
    assert calls == ["derived", "derived"]
    assert path.read_bytes() == whole
    assert fetch() == first
    assert len(calls) == 2


def test_no_unfinished_file_is_left(folder: Path, calls: list) -> None:
    fetch()
    (path,) = folder.iterdir()
    path.write_text("")
    fetch()
    assert [p.suffix for p in folder.iterdir()] == [".json"]
    assert json.loads(path.read_text().split("\n")[1])["sources"]


def test_what_cant_be_derived_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def derive() -> Program:
        raise ZeroDivisionError

    monkeypatch.setattr(standard_problems, "derive", derive)
    with pytest.raises(ZeroDivisionError):
        fetch()
    assert not folder.exists() or not list(folder.iterdir())


def test_another_source_is_another_derivation(
    folder: Path, calls: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    fetch()
    with monkeypatch.context() as patch:
        patch.setattr(kept, "source_digest", lambda *_: "another source")
        fetch()
        assert len(calls) == 2
        fetch()
        assert len(calls) == 2
    with monkeypatch.context() as patch:
        patch.setattr(kept, "version", lambda _: "0.0.1")
        fetch()
    assert len(calls) == 3
    # All three are kept, and the first one is still that of the source at hand.
    assert len(list(folder.iterdir())) == 3
    fetch()
    assert len(calls) == 3


PLUG_IN = """
import sympy as sp

from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

calls = 0

def derive():
    global calls
    calls += 1
    x, p = sp.symbols("x p", real=True)
    results = {"derivative": ([FACTOR * p * x], (1,))}
    return assemble(Tape(), {"x": [x]}, [p], results)
"""


def plug_in(path: Path, factor: int) -> ModuleType:
    """A model in a file of its own."""
    path.write_text(PLUG_IN.replace("FACTOR", str(factor)))
    # Source of equal length written within a second would be taken from Python's own cache.
    shutil.rmtree(path.parent / "__pycache__", ignore_errors=True)
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_a_plug_in_whose_source_has_changed_is_derived_again(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources_by_factor = {}
    for factor in (3, 7, 3):
        module = plug_in(tmp_path / "tiny_plug_in.py", factor)
        # `inspect` finds what stands among the imported modules.
        monkeypatch.setitem(sys.modules, "tiny_plug_in", module)
        made = fetch("tiny", module)
        seen = factor in sources_by_factor
        assert module.calls == (0 if seen else 1)
        sources_by_factor.setdefault(factor, made.source)
        assert made.source == sources_by_factor[factor]
    assert sources_by_factor[3] != sources_by_factor[7]
    assert len(list(folder.iterdir())) == 2


def test_two_models_have_two_derivations(folder: Path, calls: list) -> None:
    one, two = fetch("one"), fetch("two")
    assert len(calls) == 2
    digests = {path.stem.rpartition("_")[0]: path.stem[-16:] for path in folder.iterdir()}
    assert set(digests) == {"one", "two"}
    assert digests["one"] != digests["two"]
    # What follows from the same equations is the same, whatever the name.
    assert one == two


# Digests of sources


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of two layers and a file."""
    root = tmp_path / "package"
    for name in ("models/a.py", "models/parts/b.py", "symbolic/c.py", "other.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"# {name}\n")
    monkeypatch.setattr(cache, "PACKAGE", root)
    return root


def digest() -> str:
    return cache.source_digest(("models",), ("other.py",), ())


def test_a_digest_follows_every_file_of_its_layers(package: Path) -> None:
    seen = {digest()}
    assert seen == {digest()}
    for name in ("models/a.py", "models/parts/b.py", "other.py"):
        with (package / name).open("a") as file:
            file.write("#\n")
        seen.add(digest())
    (package / "models" / "new.py").write_text("")
    seen.add(digest())
    (package / "models" / "new.py").rename(package / "models" / "renamed.py")
    seen.add(digest())
    (package / "models" / "renamed.py").unlink()
    (package / "models" / "a.py").unlink()
    seen.add(digest())
    assert len(seen) == 7


def test_a_digest_ignores_what_is_not_of_its_layers(package: Path) -> None:
    before = digest()
    (package / "symbolic" / "c.py").write_text("changed\n")
    (package / "models" / "notes.txt").write_text("no source\n")
    assert digest() == before
    assert cache.source_digest(("models", "symbolic"), ("other.py",), ()) != before


def test_what_the_derivation_goes_by_is_in_its_layers() -> None:
    """Changing the vehicle, the tape or the emitter changes the digest."""
    files = {path.name for layer in kept.LAYERS for path in (cache.PACKAGE / layer).rglob("*.py")}
    assert {"equations.py", "tape.py", "kernel_text.py", "llvm_kernels.py"} <= files


def test_components_of_the_package_are_counted_by_their_layers_alone() -> None:
    layers = ("models",)
    assert cache.source_digest(layers, (), (definition.ModelDefinition,)) == cache.source_digest(
        layers, (), ()
    )
    plugged = cache.source_digest(layers, (), (standard_problems,))
    assert plugged != cache.source_digest(layers, (), ())


def test_derived_is_what_derivation_keeps(folder: Path) -> None:
    assert fetch() == derived(standard_problems.derive())

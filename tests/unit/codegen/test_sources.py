"""Derivations are kept under digests that follow all the source that they are made of."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.unit import standard_problems
from vehiclemor.codegen import kernels as kept
from vehiclemor.codegen import sources
from vehiclemor.codegen.kernels import derivation
from vehiclemor.codegen.sources import plug_in_digest
from vehiclemor.exceptions import PlugInError

EQUATIONS = "def derive():\n    return {}\n"
PLUG_IN = """
import sympy as sp

from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape

calls = 0

def derive():
    global calls
    calls += 1
    x, p = sp.symbols("x p", real=True)
    results = {{"derivative": ([{} * p * x], (1,))}}
    return assemble(Tape(), {{"x": [x]}}, [p], results)
"""


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Writes modules and imports one of them as in a process of its own."""
    monkeypatch.syspath_prepend(str(tmp_path))
    before = set(sys.modules)

    def imported(name: str, files: dict[str, str]):
        for file, text in files.items():
            path = tmp_path / file
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        for module in set(sys.modules) - before:
            del sys.modules[module]
        importlib.invalidate_caches()
        return importlib.import_module(name)

    yield imported
    for module in set(sys.modules) - before:
        del sys.modules[module]


def digest(component: object) -> str:
    return plug_in_digest((component,))


MODEL = {"plug/model.py": "NAME = 'plug'\n"}
PACKAGED = {**MODEL, "plug/__init__.py": ""}


@pytest.mark.parametrize(
    ("module", "files", "counted"),
    [
        ("plug.model", MODEL, "plug/equations.py"),
        ("plug.model", PACKAGED, "plug/equations.py"),
        ("single", {"single.py": "import equations_of_single\n"}, "equations_of_single.py"),
        ("single", {"single.py": "from equations_of_single import derive\n"},
         "equations_of_single.py"),
    ],
)  # fmt: skip
def test_all_files_of_a_plug_in_count(fresh, module, files, counted):
    first, again, other = (
        digest(fresh(module, {**files, counted: EQUATIONS.format(number)})) for number in (1, 1, 22)
    )
    assert first == again != other


def test_a_plug_in_whose_source_has_changed_is_derived_again(fresh, tmp_path, monkeypatch):
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path / "cache"))
    sources = {}
    # Source of equal length written within a second would be taken from Python's own cache.
    for factor in (3, 71, 3):
        module = fresh("tiny_plug_in", {"tiny_plug_in.py": PLUG_IN.format(factor)})
        found = derivation("tiny", module.derive).source
        assert module.calls == (0 if factor in sources else 1)
        assert sources.setdefault(factor, found) == found
    assert sources[3] != sources[71]


def test_what_was_edited_since_it_was_loaded_gives_no_results(fresh, tmp_path):
    files = {"edited/__init__.py": "", "edited/method.py": "def fit():\n    return 1.0\n"}
    module = fresh("edited.method", files)
    first = plug_in_digest([SimpleNamespace(fit=module.fit)])
    path = tmp_path / "edited" / "method.py"
    path.write_text("def fit():\n    return 22.0\n")
    with pytest.raises(PlugInError, match=f"{path} has changed since it was loaded"):
        plug_in_digest([SimpleNamespace(fit=module.fit)])
    importlib.reload(module)
    second = plug_in_digest([SimpleNamespace(fit=module.fit)])
    path.write_text(files["edited/method.py"])
    importlib.reload(module)
    assert plug_in_digest([SimpleNamespace(fit=module.fit)]) == first != second


# Of this package


def test_a_digest_follows_the_source_files_of_its_layers_alone(tmp_path, monkeypatch):
    package = tmp_path / "package"
    for name in ("models/a.py", "models/parts/b.py", "symbolic/c.py", "other.py"):
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(f"'{name}'; 1\n")
    monkeypatch.setattr(sources, "PACKAGE", package)

    def now() -> str:
        return sources.source_digest(("models",), ("other.py",))

    seen = {now()}
    (package / "symbolic" / "c.py").write_text("changed\n")
    (package / "models" / "notes.txt").write_text("no source\n")
    assert seen == {now()}
    for name in ("models/a.py", "models/parts/b.py", "other.py", "models/new.py"):
        with (package / name).open("a") as file:
            file.write("changed\n")
        seen.add(now())
    (package / "models" / "new.py").rename(package / "models" / "renamed.py")
    seen.add(now())
    (package / "models" / "a.py").unlink()
    seen.add(now())
    assert len(seen) == 7
    assert sources.source_digest(("models", "symbolic"), ("other.py",)) not in seen


def test_what_models_declare_in_their_files_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "data_folder", lambda: tmp_path)
    (tmp_path / "models").mkdir()
    (file := tmp_path / "models" / "car.toml").write_text("mass = 1")
    before = sources.source_digest(kept.LAYERS)
    file.write_text("mass = 2")
    assert sources.source_digest(kept.LAYERS) != before


# Derivations


@pytest.fixture
def derived(tmp_path, monkeypatch):
    """Derives the plug-in model as a process of its own does; how often it was, by its runs."""
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    made, real = [], standard_problems.derive
    monkeypatch.setattr(standard_problems, "derive", lambda: made.append(1) or real())

    def fetch(name: str = "standard_problems"):
        kept._read.cache_clear()
        return derivation(name, standard_problems.derive), len(made)

    return fetch


def test_a_model_is_derived_once_and_read_back_as_it_was(derived, tmp_path, monkeypatch):
    (first, once), (second, twice) = derived(), derived()
    assert once == twice == 1
    assert vars(first) == vars(second)
    assert first is not second
    # Another source, SymPy or name is another one.
    for number, (function, value) in enumerate((("source_digest", "other"), ("version", "0.1")), 2):
        with monkeypatch.context() as patch:
            patch.setattr(kept, function, lambda *_, value=value: value)
            assert [derived()[1], derived()[1]] == [number, number]
    renamed, count = derived("other")
    assert (vars(renamed), count) == (vars(first), 4)
    # All are kept, and the first one is still that of the source at hand.
    assert len(list((tmp_path / "derivations").iterdir())) == 4
    assert derived()[1] == 4

"""Digests of plug-ins follow all the source that they are made of."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from vehiclemor.codegen.derivation import derivation
from vehiclemor.codegen.sources import plug_in_digest
from vehiclemor.errors import PlugInError

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


@pytest.mark.parametrize("extra", [{}, {"plug/__init__.py": ""}], ids=["namespace", "package"])
def test_a_second_file_of_a_package_counts(fresh, extra):
    files = {"plug/model.py": "NAME = 'plug'\n", **extra}
    first = digest(fresh("plug.model", {**files, "plug/equations.py": EQUATIONS.format(1)}))
    again = digest(fresh("plug.model", {**files, "plug/equations.py": EQUATIONS.format(1)}))
    other = digest(fresh("plug.model", {**files, "plug/equations.py": EQUATIONS.format(2)}))
    assert first == again != other


@pytest.mark.parametrize(
    "how", ["import equations_of_single", "from equations_of_single import derive"]
)
def test_a_helper_beside_a_single_file_counts(fresh, how):
    files = {"single_model.py": f"{how}\nNAME = 'single'\n"}
    helper = "equations_of_single.py"
    first = digest(fresh("single_model", {**files, helper: EQUATIONS.format(1)}))
    other = digest(fresh("single_model", {**files, helper: EQUATIONS.format(22)}))
    assert first != other


def test_an_object_counts_by_the_source_of_its_functions(fresh):
    def component(number: int) -> SimpleNamespace:
        module = fresh("object_model", {"object_model.py": EQUATIONS.format(number)})
        return SimpleNamespace(derive=module.derive)

    assert digest(component(1)) != digest(component(22))


WRITTEN = '''
"""A plug-in."""

class Model:
    """A model."""

    def derive(self):
        """Equations."""
        return {"a": 1.0}  # in metres
'''
REWRITTEN = WRITTEN.replace("metres", "feet").replace('"""', "'").replace("1.0", "\n1.00")


@pytest.mark.parametrize(
    ("text", "same"),
    [
        (REWRITTEN.replace("model", "car"), True),
        (REWRITTEN.replace("        'Equations.'\n", ""), True),
        (WRITTEN.replace("1.0", "1.1"), False),
        (WRITTEN.replace("return {", "return 'a text', {"), False),
        (WRITTEN.replace("        return", "        for _ in ():\n            return"), False),
    ],
)
def test_a_text_counts_by_what_it_says(fresh, text, same):
    first = digest(fresh("told", {"told.py": WRITTEN}))
    assert (digest(fresh("told", {"told.py": text})) == first) == same


def test_a_file_that_is_no_python_counts_by_its_bytes(fresh):
    texts = "{{ name }} = 1 # a", "{{ name }} = 1 # b", "é = '\\ud800'", "x = " + "(" * 999
    files = [{"plug/model.py": "", "plug/template.py": text} for text in texts]
    assert len({digest(fresh("plug.model", held)) for held in files}) == len(texts)


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

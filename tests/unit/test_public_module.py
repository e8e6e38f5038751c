"""`vehiclemor.plugin`: what plug-ins import, and all that the template and the examples do."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from vehiclemor import plugin
from vehiclemor.files import data_folder

EXAMPLES = Path(__file__).parents[2] / "examples"
SOURCES = [
    *(data_folder() / "plugin_template").rglob("*.py"),
    *(EXAMPLES / f"{name}.py" for name in ("my_model", "my_method")),
]
STABLE = (
    *("Declared", "Maneuver", "Method", "ModelDefinition", "OfflineCost", "Quantity", "Settings"),
    *("ReducedMechanism", "ReducedSystem", "Structure", "Tape", "Trust", "AT_MOST_COORDINATES"),
    *("assemble", "check_method", "check_model", "clock", "offline_cost"),
)


def test_it_has_the_names_that_stay_stable():
    assert set(STABLE) <= set(dir(plugin))
    for name in dir(plugin):
        assert getattr(plugin, name, None) is not None, name
    with pytest.raises(AttributeError, match="no_such"):
        _ = plugin.no_such


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_template_and_examples_import_nothing_deeper(path):
    imported = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            imported.add(node.module)
        elif isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
    assert {name for name in imported if name.startswith("vehiclemor")} <= {
        "vehiclemor",
        "vehiclemor.plugin",
    }


def test_what_a_method_imports_does_not_bring_sympy():
    names = "Method, OfflineCost, Settings, Trust, clock, offline_cost"
    text = f"import sys; from vehiclemor.plugin import {names}; print('sympy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"

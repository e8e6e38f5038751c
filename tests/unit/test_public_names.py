"""The names of the package stay what they are, whatever was imported and used before."""

import pkgutil
import subprocess
import sys

import pytest

import vehiclemor as vm

# Everything that a session may have imported and used before a name is asked for.
USED = """
import importlib, pkgutil
import vehiclemor as vm
vm.simulate("double_wishbone", "pod")
for found in pkgutil.walk_packages(vm.__path__, "vehiclemor."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)
from vehiclemor import api
for name in vm.__all__:
    value = getattr(vm, name)
    if getattr(value, "__module__", None) != vm._DEFINED_IN[name]:
        raise SystemExit(f"vehiclemor.{name} is {value!r}")
for name in ("models", "methods", "maneuvers", "studies"):
    assert getattr(vm, name)(), name
"""


def test_public_names_after_everything_was_used():
    done = subprocess.run([sys.executable, "-c", USED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_module_with_the_name_of_a_public_function_is_that_function():
    # Python puts the module in its place as soon as anything imports it.
    modules = {module.name for module in pkgutil.iter_modules(vm.__path__)}
    assert modules & set(vm.__all__) == {"maneuver"}
    assert vm.maneuver is sys.modules["vehiclemor.maneuver"]
    assert vm.maneuver("sine_travel").name == "sine_travel"


@pytest.mark.parametrize("name", vm.__all__)
def test_public_names_are_documented(name):
    assert getattr(vm, name).__doc__

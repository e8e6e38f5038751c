"""The names of the package stay what they are, whatever was imported and used before."""

import subprocess
import sys

import vehiclemor as vm

# Everything that a session may have imported and used before a name is asked for: Python puts a
# module in the place of a name as soon as anything imports it.
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


def test_public_names_are_documented_and_one_is_a_module_too():
    for name in vm.__all__:
        assert getattr(vm, name).__doc__
    assert vm.maneuver is sys.modules["vehiclemor.maneuver"]
    assert vm.maneuver("sine_travel").name == "sine_travel"

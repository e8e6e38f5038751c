"""The compiled time loops that all dynamic models share."""

from functools import cache
from types import ModuleType

from vehiclemor.codegen.cache import load_module
from vehiclemor.codegen.sources import source_digest

LOOPS = (
    "system_loops",
    "explicit_loops",
    "rosenbrock_loops",
    "w_method_loops",
    "stepped_loops",
    "exponential_loops",
    "modal_loops",
    "run_loops",
)


@cache
def loops_digest() -> str:
    """Hash of the source of the loops and of what compiles them."""
    return source_digest(("codegen",), tuple(f"simulation/{name}.py" for name in LOOPS), ())


@cache
def loops_module() -> ModuleType:
    """Compiled loops that run every dynamic model."""
    from importlib import import_module

    from vehiclemor.codegen.link import loops_source

    modules = [import_module(f"vehiclemor.simulation.{name}") for name in LOOPS]
    return load_module("dynamic_loops", loops_source(modules, "the loops of dynamic models"))

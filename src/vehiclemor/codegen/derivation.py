"""What the derivation of a dynamic model leaves behind, kept on disk.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the source of
the kernels is kept with all that describes them, under the hash of the source that it was derived
by: the model, the symbolic layer and this one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING

from vehiclemor.codegen.cache import cache_folder, fetched
from vehiclemor.codegen.kernels import Kernels, KernelSource, kernel_sources
from vehiclemor.codegen.sources import plug_in_digest, source_digest
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

LAYERS = ("multibody", "symbolic", "codegen")


@dataclass(frozen=True)
class Derivation(ShortRepr):
    """What is left of a model's program: the sources of its kernels, and what describes them.

    Attributes
    ----------
    shapes
        Function -> shape of its result.
    constants
        Number of hoisted constants.
    sources
        Kernel -> its source; `constants` makes the hoisted ones from the parameters.
    operations
        Function -> exact counts of its operations, see `operation_counts`.
    copied
        By output the number of the state that it is, -1 where it is another quantity.
    """

    shapes: dict[str, tuple[int, ...]]
    constants: int
    sources: dict[str, KernelSource]
    operations: dict[str, dict[str, int]]
    copied: tuple[int, ...]

    @property
    def source(self) -> str:
        """Text of all kernels."""
        return "\n".join(kernel.text for kernel in self.sources.values())

    @cached_property
    def kernels(self) -> Kernels:
        """The kernels, compiled when they are first used."""
        return Kernels(self.sources)


def derivation(name: str, derive: Callable[[], Program]) -> Derivation:
    """The derivation of a model: from disk, or made by `derive` and written there."""

    def make() -> bytes:
        return json.dumps(asdict(derived(derive()))).encode()

    return _read(fetched(_file(name, derive), make))


def is_derived(name: str, derive: Callable[[], Program]) -> bool:
    """Whether the derivation of a model is on disk."""
    return (cache_folder() / _file(name, derive)).exists()


def _file(name: str, derive: Callable[[], Program]) -> str:
    parts = [source_digest(LAYERS), plug_in_digest((derive,)), name, f"sympy {version('sympy')}"]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    return f"derivations/{name}_{digest}.json"


def derived(program: Program) -> Derivation:
    """Sources and description of the kernels of a program."""
    # Only here is anything symbolic: a model that was derived before starts without it.
    from vehiclemor.codegen.kernel_text import kernel_source, operation_counts, tangent_source

    text = kernel_source(program)
    further = tangent_source(program) if "residual_jacobian" in program.functions else ""
    states = next(iter(program.arguments.values()))
    outputs = program.functions["outputs"].results if "outputs" in program.functions else ()
    return Derivation(
        shapes={key: function.shape for key, function in program.functions.items()},
        constants=len(program.constant_symbols),
        sources=kernel_sources(text + further),
        operations=operation_counts(text),
        copied=tuple(states.index(output) if output in states else -1 for output in outputs),
    )


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(content: bytes) -> Derivation:
    written = json.loads(content)
    written["shapes"] = {key: tuple(shape) for key, shape in written["shapes"].items()}
    written["copied"] = tuple(written["copied"])
    for kernel in written["sources"].values():
        kernel |= {key: tuple(kernel[key]) for key in ("arguments", "sizes")}
    written["sources"] = {key: KernelSource(**kernel) for key, kernel in written["sources"].items()}
    return Derivation(**written)

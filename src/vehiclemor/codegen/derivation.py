"""What the derivation of a dynamic model leaves behind, kept on disk.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the
kernels' operations are kept with all that describes them, under the hash of the source that they
were derived by: the model, the symbolic layer and this one.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING

from vehiclemor.codegen.cache import cache_folder, digest_of, fetched
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.operations import Kernel
from vehiclemor.codegen.sources import plug_in_digest, source_digest
from vehiclemor.short_repr import ShortRepr

if TYPE_CHECKING:
    from vehiclemor.symbolic.program import Program

LAYERS = ("multibody", "symbolic", "codegen")
# Kernels beside the functions of a program.
BESIDE = ("constants", "tangent_parts", "tangent")


@dataclass(frozen=True)
class Derivation(ShortRepr):
    """What is left of a program: kernels by name; `constants` gives those of the parameters."""

    sources: dict[str, Kernel]

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Function -> shape of its result."""
        return {name: k.shape for name, k in self.sources.items() if name not in BESIDE}

    @property
    def constants(self) -> int:
        """Number of hoisted constants."""
        return self.sources["constants"].shape[0]

    @property
    def source(self) -> str:
        """All kernels, in one line each."""
        return "\n".join(map(repr, self.sources.values()))

    @cached_property
    def operations(self) -> dict[str, dict[str, int]]:
        """Function -> exact counts of its operations, see `Kernel.counts`."""
        return {name: self.sources[name].counts for name in ("constants", *self.shapes)}

    @cached_property
    def kernels(self) -> Kernels:
        """The kernels, compiled when they are first used."""
        return Kernels(self.sources.values())


def derivation(name: str, derive: Callable[[], Program]) -> Derivation:
    """The derivation of a model: from disk, or made by `derive` and written there."""

    def make() -> bytes:
        # Only here is anything symbolic: a model that was derived before starts without it.
        from vehiclemor.codegen.lowering import kernels_of

        return json.dumps([asdict(kernel) for kernel in kernels_of(derive()).values()]).encode()

    return _read(fetched(_file(name, derive), make))


def is_derived(name: str, derive: Callable[[], Program]) -> bool:
    """Whether the derivation of a model is on disk."""
    return (cache_folder() / _file(name, derive)).exists()


def _file(name: str, derive: Callable[[], Program]) -> str:
    parts = source_digest(LAYERS), plug_in_digest((derive,)), name, f"sympy {version('sympy')}"
    return f"derivations/{name}_{digest_of(parts)}.json"


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(content: bytes) -> Derivation:
    kernels = map(Kernel.read, json.loads(content))
    return Derivation({kernel.name: kernel for kernel in kernels})

"""What the derivation of a dynamic model leaves behind, kept on disk.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the source of
the kernels is kept with all that describes them, under the hash of the source that it was derived
by: the model, the symbolic layer and this one.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from vehiclemor.codegen.kernels import Kernels, KernelSource, kernel_sources
from vehiclemor.codegen.object_cache import fetched
from vehiclemor.codegen.sources import source_digest
from vehiclemor.models.quantities import Quantity

if TYPE_CHECKING:
    from vehiclemor.models.equations import AlgebraicEquations, DynamicEquations

LAYERS = ("models", "symbolic", "codegen")
QUANTITIES = ("coordinates", "speeds", "inputs", "outputs", "constraints", "equations")


@dataclass(frozen=True)
class Derivation:
    """Named quantities of a model, and the sources of its kernels.

    Attributes
    ----------
    coordinates, speeds, inputs, outputs, constraints, equations, joints
        As in `AlgebraicEquations` and `DynamicEquations`; empty where a kind has none.
    shapes
        Function -> shape of its result.
    constants
        Number of hoisted constants.
    sources
        Kernel -> its source; `constants` makes the hoisted ones from the parameters.
    operations
        Function -> exact counts of its operations, see `operation_counts`.
    """

    coordinates: tuple[Quantity, ...]
    speeds: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    constraints: tuple[Quantity, ...]
    equations: tuple[Quantity, ...]
    joints: tuple[str, ...]
    shapes: dict[str, tuple[int, ...]]
    constants: int
    sources: dict[str, KernelSource]
    operations: dict[str, dict[str, int]]

    @property
    def source(self) -> str:
        """Text of all kernels."""
        return "\n".join(kernel.text for kernel in self.sources.values())

    @property
    def kernels(self) -> Kernels:
        """The kernels, compiled when they are first used."""
        return Kernels(self.sources)


def derivation(name: str, definition: Any) -> Derivation:
    """The derivation of a registered model: from disk, or made and written there."""
    parts = [source_digest(LAYERS, (), (definition,)), name, f"sympy {version('sympy')}"]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]

    def make() -> bytes:
        return json.dumps(asdict(derived(definition.derive()))).encode()

    return _read(fetched(f"derivations/{name}_{digest}.json", make))


def derived(equations: AlgebraicEquations | DynamicEquations) -> Derivation:
    """Sources and description of the kernels of a model's equations."""
    # Only here is anything symbolic: a model that was derived before starts without it.
    from vehiclemor.codegen.kernel_text import kernel_source, operation_counts, tangent_source

    program = equations.program
    text = kernel_source(program)
    further = tangent_source(program) if "residual_jacobian" in program.functions else ""
    named = {name: getattr(equations, name, ()) for name in (*QUANTITIES, "joints")}
    return Derivation(
        **named,
        shapes={key: function.shape for key, function in program.functions.items()},
        constants=len(program.constant_symbols),
        sources=kernel_sources(text + further),
        operations=operation_counts(text),
    )


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(content: bytes) -> Derivation:
    written = json.loads(content)
    for key in QUANTITIES:
        written[key] = tuple(Quantity(**entry) for entry in written[key])
    written["shapes"] = {key: tuple(shape) for key, shape in written["shapes"].items()}
    written["joints"] = tuple(written["joints"])
    for kernel in written["sources"].values():
        kernel |= {key: tuple(kernel[key]) for key in ("arguments", "sizes")}
    written["sources"] = {key: KernelSource(**kernel) for key, kernel in written["sources"].items()}
    return Derivation(**{field.name: written[field.name] for field in fields(Derivation)})

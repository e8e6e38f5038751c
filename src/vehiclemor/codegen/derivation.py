"""What the derivation of a dynamic model leaves behind, kept on disk.

Deriving a vehicle symbolically takes seconds, loading its machine code does not.  So the source of
the kernels is kept with all that describes them, under the hash of the source that it was derived
by: the model, the symbolic layer and this one.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vehiclemor.codegen.cache import cache_folder, write_whole
from vehiclemor.codegen.link import kernels_source
from vehiclemor.codegen.sources import source_digest
from vehiclemor.models.quantities import Quantity

if TYPE_CHECKING:
    from vehiclemor.models.equations import DynamicEquations

LAYERS = ("models", "symbolic", "codegen")
QUANTITIES = ("coordinates", "speeds", "inputs", "outputs", "constraints")


@dataclass(frozen=True)
class Derivation:
    """Named quantities of a dynamic model, and the source of its kernels.

    Attributes
    ----------
    coordinates, speeds, inputs, outputs, constraints
        As in `DynamicEquations`.
    shapes
        Function -> shape of its result.
    source
        Module of kernels, see `link.kernels_source`.
    operations
        Function -> exact counts of its operations, see `emit.operation_counts`.
    """

    coordinates: tuple[Quantity, ...]
    speeds: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    constraints: tuple[Quantity, ...]
    shapes: dict[str, tuple[int, ...]]
    source: str
    operations: dict[str, dict[str, int]]


def derivation(name: str, definition: Any) -> Derivation:
    """The derivation of a registered model: from disk, or made and written there."""
    parts = [source_digest(LAYERS, (), (definition,)), name, f"sympy {version('sympy')}"]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    path = cache_folder() / "derivations" / f"{name}_{digest}.json"
    try:
        return _read(path)
    except (OSError, ValueError):
        made = derived(name, definition.derive())
    write_whole(path, _text(made))
    return _read(path)


def derived(name: str, equations: DynamicEquations) -> Derivation:
    """Source and description of the kernels of a model's equations."""
    # Only here is anything symbolic: a model that was derived before starts without it.
    from vehiclemor.codegen.emit import (
        kernel_source,
        operation_counts,
        reference_source,
        work_size,
    )

    program = equations.program
    sizes = {"WORK": work_size(program), "CONSTANTS": len(program.constant_symbols)}
    return Derivation(
        equations.coordinates,
        equations.speeds,
        equations.inputs,
        equations.outputs,
        equations.constraints,
        {key: function.shape for key, function in program.functions.items()},
        kernels_source(kernel_source(program), sizes, f"model {name}"),
        operation_counts(reference_source(program)),
    )


def _text(made: Derivation) -> str:
    """Text of a derivation after the hash of that text."""
    content = json.dumps(asdict(made))
    return f"{hashlib.sha256(content.encode()).hexdigest()}\n{content}"


# A derivation does not change under its digest.
@lru_cache(maxsize=8)
def _read(path: Path) -> Derivation:
    """A derivation from its file; `ValueError` if that isn't as it was written."""
    digest, _, written = path.read_text(encoding="utf-8").partition("\n")
    if digest != hashlib.sha256(written.encode()).hexdigest():
        raise ValueError("the file is damaged")
    content = json.loads(written)
    quantities = {key: tuple(Quantity(**entry) for entry in content[key]) for key in QUANTITIES}
    shapes = {key: tuple(shape) for key, shape in content["shapes"].items()}
    return Derivation(
        **quantities,
        shapes=shapes,
        source=content["source"],
        operations=content["operations"],
    )

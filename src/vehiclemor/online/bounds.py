"""Parts that come from a file, checked before compiled code gets them: it does not look.

A kernel reads and writes at the places that its text names, a loop as far as an array is long, so
that a file that lies about sizes would reach into other memory.  Whatever fails is a `ValueError`.
"""

import ast
import math
import re
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from vehiclemor.codegen.kernel_statements import KernelText
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.llvm_kernels import kernel_module
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.codegen.vector_statements import NAMES
from vehiclemor.reduction.methods.path_map import PathMapModel
from vehiclemor.reduction.methods.polynomial_residual import PolynomialResidualModel
from vehiclemor.reduction.projection.algebraic import AlgebraicProjection
from vehiclemor.reduction.projection.car_subspaces import Subspaces
from vehiclemor.reduction.projection.dynamic import DynamicProjection
from vehiclemor.reduction.reduced_system import FullStates, ReducedSystem
from vehiclemor.reduction.vehicle.features import PLANAR, Features
from vehiclemor.reduction.vehicle.lifting_loops import LEVELS
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.reduction.vehicle.slow_cars import SlowVehicle
from vehiclemor.reduction.vehicle.two_track_cars import TwoTrackVehicle
from vehiclemor.reduction.vehicle.two_track_fit import FEATURES
from vehiclemor.simulation.projection_windows import FORMULATIONS, ProjectionWindows
from vehiclemor.simulation.system import System

ARGUMENTS = ("_x", "_u", "_constants", "_result")
# Statements that read and write more than their text names.
WHOLE_VECTORS = re.compile(rf"\b({'|'.join(NAMES)})\s*\(")


def check(part: Any) -> None:
    """Raise `ValueError` if a part is not of the sizes that others will take it for."""
    match part:
        case Kernels():
            for source in part.sources.values():
                _require(not WHOLE_VECTORS.search(source.text), f"kernel {source.name}")
                # Whatever is no straight-line arithmetic is found now, not at the first run.
                kernel_module([KernelText(source.text)])
        case Features():
            _check_features(part)
        case ReducedVehicle():
            _check_vehicle(part)
        case System():
            _check_system(part)
        case ReducedSystem():
            _check_reduced_system(part)
        case AlgebraicProjection():
            n = len(part.model.coordinates)
            _require(len(part.edges) == len(part.bases) + 1, "edges")
            for basis in part.bases:
                _shaped("bases", (basis.mean, n), (basis.vectors, n, basis.rank))
        case PathMapModel():
            _check_map(part)
        case PolynomialResidualModel():
            n, inputs, r = len(part.model.coordinates), len(part.model.inputs), part.basis.rank
            terms = math.comb(r + part.degree, r)
            _shaped("basis", (part.basis.mean, n), (part.basis.vectors, n, r), (part.scales, r))
            _shaped("response", (part.mean_inputs, inputs), (part.response, inputs, r))
            _shaped("coefficients", (part.coefficients, terms, r))


def _check_features(part: Features) -> None:
    for name, _ in part.lines:
        _require(name.isidentifier() and not name.startswith("_"), f"line {name!r}")
    _places(part)
    for terms, columns in part.blocks:
        _within("groups", terms, len(part.terms))
        _within("groups", columns, part.states + PLANAR)
    fits = all(size > 0 for size in part.diagonal) and sum(part.diagonal) <= part.states
    _require(fits, "diagonal")


def _places(part: Features) -> int:
    """Number of parameters that features need; their texts reach into nothing else."""
    most = 0
    texts = (*part.terms, *(text for _, text in part.lines), *(text for text, _ in part.watched))
    for text in texts:
        for node in ast.walk(ast.parse(text, mode="eval")):
            if isinstance(node, ast.Name):
                _require(not node.id.startswith("_"), f"feature {text[:40]!r}")
            if isinstance(node, ast.Subscript):
                place = getattr(node.slice, "value", -1)
                _require(ast.unparse(node.value) == "p", f"feature {text[:40]!r}")
                _within(f"feature {text[:40]!r}", [place], sys.maxsize)
                most = max(most, place + 1)
    return most


def _check_vehicle(part: ReducedVehicle) -> None:
    own, lifted = part.features, part.lifted_features or part.features
    k, n, inputs = own.states, len(part.shape.kept), len(part.model.inputs)
    same = (own.inputs, lifted.inputs, lifted.states) == (inputs, inputs, k)
    _require(same and part.shape.model is part.model, "features")
    _require(part.parameters.ndim == 1, "parameters")
    _require(len(part.parameters) >= max(_places(own), _places(lifted)), "parameters")
    _shaped("coefficients", (part.coefficients, len(own.terms), k + PLANAR))
    _shaped("lifting", (part.lifting, len(lifted.terms), n))
    _shaped("encoding", (part.encoding, k, n), (part.feedthrough, k, inputs))
    _shaped("error_scale", (part.error_scale, k + PLANAR))
    if isinstance(part, SlowVehicle) and part.box is not None:
        box, free = part.box, sum(len(terms) for terms, _ in part.box.table.free)
        _shaped("box", (box.coefficients, *part.coefficients.shape))
        _shaped("box", (box.changes, 1 + len(box.cars.varied), free))
        _require(box.table.features == own, "box")
    if isinstance(part, TwoTrackVehicle) and part.box is not None:
        # Of these another car's features are made.
        texts = {*own.terms, *lifted.terms}
        _require(all(set(part.box.chosen[kind]) <= texts for kind in FEATURES), "box")
    reach = part.reach
    _require(own.lateral == lifted.lateral <= len(lifted.watched), "lateral")
    if len(reach.lasted):
        modes, starts = len(part.transient.rates), len(reach.begun)
        _shaped("lasted", (reach.lasted, 2 * lifted.lateral, LEVELS), (reach.decaying, modes))
        _shaped("steered", (reach.steered, modes))
        _shaped("starts", (reach.left, n), (reach.starts, starts, n), (reach.begun, starts))


def _check_system(part: System) -> None:
    dim, n = len(part.reference), len(part.constants)
    results = {"derivative": dim, "speeds": dim // 2, "second_order": dim // 2 * (dim // 2 + 1)}
    for name, source in part.kernels.sources.items():
        if name in (*results, "full_state"):
            most = (dim, part.inputs, n, results.get(name, source.sizes[-1]))
            fits = all(size <= limit for size, limit in zip(source.sizes, most, strict=False))
            _require(source.arguments == ARGUMENTS and fits, f"kernel {name}")
    _shaped("system", (part.reference, dim), (part.error_scale, dim), (part.constants, n))
    _require(not part.fused and not part.diagonal, "fused")
    _require(len(part.partners) in (0, dim), "partners")
    for name in ("active", "rotating", "partners"):
        _within(name, getattr(part, name).tolist(), dim)


def _check_reduced_system(part: ReducedSystem) -> None:
    system, spaces, dim = part.system, part.spaces, len(part.system.reference)
    states = len(part.model.definition.states)
    _require(system.inputs == len(part.model.inputs), "inputs")
    lifting = getattr(part.lift, "__self__", None)
    if isinstance(lifting, FullStates):
        written = lifting.system.kernels.sources["full_state"].sizes[-1]
        _require(written <= lifting.size == states, "full_state")
        _require(lifting.system is system, "full_state")
    else:
        _require(dim == states, "system")
    _check_windows(spaces, dim)
    if isinstance(part, DynamicProjection) and part.subspaces is not None:
        _check_subspaces(part.subspaces, dim)


def _check_subspaces(part: Subspaces, dim: int) -> None:
    width, windows = len(part.weight), len(part.local)
    _require(width in (dim, dim // 2) and len(part.edges) == windows + 1, "subspaces")
    _shaped("weight", (part.weight, width, width))
    cars = len(part.local[0].means) if windows else 0
    _require(cars in (1, len(part.cars.values)), "cars")
    for local in part.local:
        rank = local.origin.shape[-1]
        _shaped("means", (local.means, cars, dim), (local.origin, width, rank))
        _shaped("tangents", (local.tangents, cars, width, rank))


def _check_windows(part: ProjectionWindows, dim: int) -> None:
    windows = len(part.ranks)
    _require(part.formulation in FORMULATIONS and len(part.edges) == windows + 1, "edges")
    if part.formulation == "full":
        _require(part.ranks.tolist() == [dim], "ranks")
        return
    rows = part.trial_basis.shape[1]
    bases = (part.trial_basis, windows, rows, dim), (part.test_basis, windows, rows, dim)
    _shaped("spaces", (part.means, windows, dim), *bases)
    # A coordinate and its rate share a row where coordinates are projected.
    most = rows * (2 if part.formulation == "coordinates" else 1)
    _within("ranks", part.ranks.tolist(), most + 1)


def _check_map(part: PathMapModel) -> None:
    inputs, cells = len(part.model.inputs), part.cells
    _shaped("ranges", (part.ranges, inputs, 2), (cells.centres, inputs), (cells.scales, inputs))
    _shaped("cells", (cells.halves, inputs), (cells.tops, inputs))
    _within("moving", part.moving, inputs)
    _require(len(part.columns) == len(part.model.coordinates) + len(part.model.outputs), "columns")
    numbers = cells.numbers.tolist()
    _require(len(numbers) == inputs and min(numbers) > 0, "numbers")
    _require(np.array_equal(cells.tops, cells.numbers - 1.0), "tops")
    terms = math.comb(len(part.moving) + part.degree, part.degree)
    width = padded(max(part.columns) + 1)
    _shaped("coefficients", (cells.coefficients, math.prod(numbers), terms, width))


def _shaped(what: str, *arrays: Sequence[Any]) -> None:
    """Require floats of these shapes."""
    for array, *shape in arrays:
        _require(array.dtype == float and array.shape == tuple(shape), what)


def _within(what: str, places: Iterable[int], size: int) -> None:
    _require(all(isinstance(place, int) and 0 <= place < size for place in places), what)


def _require(fits: bool, what: str) -> None:
    if not fits:
        raise ValueError(f"{what} does not fit the rest")

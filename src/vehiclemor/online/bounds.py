"""Parts that come from a file, checked before compiled code gets them: it does not look.

A kernel reads and writes at the places that its text names, a loop as far as an array is long, so
that a file that lies about sizes would reach into other memory.  Whatever fails is a `ValueError`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from types import UnionType
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from vehiclemor.codegen.foreign_texts import MOST_CHARACTERS, MOST_SIZE, check_line
from vehiclemor.codegen.vector_lanes import padded
from vehiclemor.reduction.methods import guarded, path_map
from vehiclemor.reduction.methods.guarded import GuardedModel
from vehiclemor.reduction.methods.path_map import PathMapModel
from vehiclemor.reduction.projection.algebraic import AlgebraicProjection
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.validation import checked_fit
from vehiclemor.reduction.vehicle.features import PLANAR, Features
from vehiclemor.reduction.vehicle.lifting_loops import LEVELS
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.projection_windows import FORMULATIONS, ProjectionWindows
from vehiclemor.simulation.system import System
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.input_range import InputRange

# Reduced coordinates; the models of this package have at most 9.
MOST_STATES = 100


def check(part: Any, model: Model) -> None:
    """Raise `ValueError` if a part of a reduced model is not what others will take it for."""
    if type(part).__module__.startswith("vehiclemor."):
        for name, kind in _declared(type(part)).items():
            _require(_is(getattr(part, name), kind), name)
    match part:
        case InputRange():
            kinds = 1 if model.kind == "ae" else 3
            _shaped("largest", (part.largest, kinds, len(model.inputs)))
        case Features():
            _parameters(part)
        case ReducedVehicle():
            _check_vehicle(part)
        case System():
            _check_system(part)
        case ReducedSystem():
            _check_reduced_system(part)
        case Trajectory():
            samples = max(len(part.time), 1)
            _shaped("time", (part.time, samples))
            for name in ("inputs", "coordinates", "speeds", "outputs"):
                _shaped(name, (getattr(part, name), samples, len(getattr(model, name))))
        case GuardedModel():
            for each in (part.fast, part.safe):
                checked_fit(guarded.NAME, each)
        case AlgebraicProjection():
            n = len(part.model.coordinates)
            _require(len(part.edges) == len(part.bases) + 1, "edges")
            for basis in part.bases:
                _shaped("bases", (basis.mean, n), (basis.vectors, n, basis.rank))
                _require(basis.rank <= n, "bases")
        case PathMapModel():
            _check_map(part)


@cache
def _declared(kind: type) -> Mapping[str, Any]:
    """Fields of a dataclass or a named tuple, with their types."""
    names = getattr(kind, "__dataclass_fields__", getattr(kind, "_fields", ()))
    hints = get_type_hints(kind) if names else {}
    return {name: of for name, of in hints.items() if get_origin(of) is not ClassVar}


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is of a declared type; what is made of others is of it in all its parts."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return any(_is(value, one) for one in inner)
    if origin is tuple and inner[-1:] != (...,):
        fits = isinstance(value, tuple) and len(value) == len(inner)
        return fits and all(map(_is, value, inner))
    if origin in (tuple, list):
        return isinstance(value, origin) and all(_is(part, inner[0]) for part in value)
    if origin in (dict, Mapping):
        return isinstance(value, Mapping) and all(_is(v, inner[1]) for v in value.values())
    if origin is Callable:
        return callable(value)
    if kind is Any or getattr(kind, "_is_protocol", False):
        return True
    # A truth value is a whole number to Python, and that is a float to the type's author.
    wider = (float, int) if kind is float else kind
    return isinstance(value, wider) and (kind is bool or not isinstance(value, bool))


@lru_cache(maxsize=64)
def _parameters(part: Features) -> int:
    """Number of parameters that features need; their texts reach into nothing else."""
    _require(0 < part.states <= MOST_STATES and 0 <= part.inputs <= MOST_STATES, "states")
    lines = [*part.lines, *(("term", text) for text in part.terms)]
    lines += [("watched", text) for text, _ in part.watched]
    _require(sum(len(text) for _, text in lines) <= MOST_CHARACTERS, "features")
    known = {f"z{i}" for i in range(part.states)} | {f"u{i}" for i in range(part.inputs)}
    sizes, most = [], 0
    for number, (name, text) in enumerate(lines):
        size, needed = check_line(name, text, known)
        sizes.append(size)
        most = max(most, needed)
        if number < len(part.lines):
            known.add(name)
    own, total = sizes[len(part.lines) :], sum(sizes)
    _require(len(part.groups) <= part.states + PLANAR, "groups")
    for terms, columns in part.blocks:
        _apart("groups", terms, len(part.terms))
        _apart("groups", columns, part.states + PLANAR)
        _require(bool(terms and columns), "groups")
        total += sum(own[j] for j in terms) + len(terms) * padded(len(columns))
    _require(total <= MOST_SIZE, "features")
    return most


def _check_vehicle(part: ReducedVehicle) -> None:
    own, lifted = part.features, part.lifted_features or part.features
    k, n, inputs = own.states, len(part.shape.kept), len(part.model.inputs)
    _require((own.inputs, lifted.inputs, lifted.states) == (inputs, inputs, k), "features")
    _require(part.parameters.ndim == 1 and part.parameters.dtype == float, "parameters")
    _require(len(part.parameters) >= max(_parameters(own), _parameters(lifted)), "parameters")
    _shaped("coefficients", (part.coefficients, len(own.terms), k + PLANAR))
    _shaped("lifting", (part.lifting, len(lifted.terms), n))
    _shaped("encoding", (part.encoding, k, n), (part.feedthrough, k, inputs))
    _shaped("error_scale", (part.error_scale, k + PLANAR))
    modes = len(part.transient.rates)
    for vectors in (part.transient.left, part.transient.right):
        _require(not modes or vectors.shape == (modes, n), "transient")
    _require(modes <= n, "transient")
    reach = part.reach
    if reach.inputs.size:
        _shaped("reach", (reach.inputs, 3, inputs))
    _require(0 <= own.lateral == lifted.lateral <= len(lifted.watched), "lateral")
    if len(reach.lasted):
        starts = len(reach.begun)
        _shaped("lasted", (reach.lasted, 2 * lifted.lateral, LEVELS), (reach.decaying, modes))
        _shaped("steered", (reach.steered, modes))
        _shaped("starts", (reach.left, n), (reach.starts, starts, n), (reach.begun, starts))


def _check_system(part: System) -> None:
    dim, n = len(part.reference), len(part.constants)
    _shaped("system", (part.reference, dim), (part.error_scale, dim), (part.constants, n))
    for name in ("active", "rotating", "partners"):
        _apart(name, getattr(part, name).tolist(), dim)
    _require(len(part.rotating) % 2 == 1 or not part.rotating.size, "rotating")
    mirrored = part.partners[part.partners].tolist()
    _require(mirrored in ([], list(range(dim))), "partners")


def _check_reduced_system(part: ReducedSystem) -> None:
    system, spaces, dim = part.system, part.spaces, len(part.system.reference)
    states = len(part.model.definition.states)
    _require(system.inputs == len(part.model.inputs), "inputs")
    _require(dim == states, "system")
    if source := system.kernels.sources.get("outputs"):
        source.check(dim, system.inputs, len(system.constants), len(part.model.outputs))
    _check_windows(spaces, dim)


def _check_windows(part: ProjectionWindows, dim: int) -> None:
    windows = len(part.ranks)
    _require(part.formulation in FORMULATIONS and len(part.edges) == windows + 1 > 1, "edges")
    full = part.formulation == "full"
    rows, columns = (1, 1) if full else (part.trial_basis.shape[1], dim)
    bases = (part.trial_basis, windows, rows, columns), (part.test_basis, windows, rows, columns)
    _shaped("spaces", (part.edges, windows + 1), (part.means, windows, columns), *bases)
    # A coordinate and its rate share a row where coordinates are projected.
    most = dim if full else rows * (2 if part.formulation == "coordinates" else 1)
    _within("ranks", part.ranks.tolist(), min(most, dim) + 1)
    _require(not full or part.ranks.tolist() == [dim], "ranks")


def _check_map(part: PathMapModel) -> None:
    inputs, cells = len(part.model.inputs), part.cells
    _shaped("ranges", (part.ranges, inputs, 2), (cells.centres, inputs), (cells.scales, inputs))
    _shaped("cells", (cells.halves, inputs), (cells.tops, inputs))
    # What is no number would be a place anywhere.
    _require(
        bool(np.isfinite([*cells.centres, *cells.scales, *part.ranges.ravel()]).all()), "cells"
    )
    _apart("moving", part.moving, inputs)
    _require(0 <= part.degree <= path_map.HIGHEST_DEGREE, "degree")
    _require(len(part.columns) == len(part.model.coordinates) + len(part.model.outputs), "columns")
    _within("columns", part.columns, len(part.columns))
    numbers = cells.numbers.tolist()
    _require(len(numbers) == inputs and min(numbers) > 0, "numbers")
    _require(np.array_equal(cells.tops, cells.numbers - 1.0), "tops")
    _require(np.array_equal(cells.halves, 0.5 * cells.numbers), "halves")
    terms = math.comb(len(part.moving) + part.degree, part.degree)
    width = padded(max(part.columns) + 1)
    _shaped("coefficients", (cells.coefficients, math.prod(numbers), terms, width))
    _require(bool(part.moving) and terms * width <= MOST_SIZE, "degree")


def _shaped(what: str, *arrays: Sequence[Any]) -> None:
    """Require floats of these shapes."""
    for array, *shape in arrays:
        _require(array.dtype == float and array.shape == tuple(shape), what)


def _within(what: str, places: Sequence[Any], size: int) -> None:
    """Require whole numbers of at least zero and below a size."""
    _require(all(type(place) is int and 0 <= place < size for place in places), what)


def _apart(what: str, places: Sequence[Any], size: int) -> None:
    """Require the same, each once."""
    _require(len(places) <= size, what)
    _within(what, places, size)
    _require(len({*places}) == len(places), what)


def _require(fits: bool, what: str) -> None:
    if not fits:
        raise ValueError(f"{what} does not fit the rest")

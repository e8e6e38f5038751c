"""Path map: coordinates and outputs of a mechanism as polynomials of its inputs.

The configurations of a suspension form a surface over wheel travel and rack displacement, a curve
where the rack rests.  It is analytic, so that interpolation in Chebyshev points converges
geometrically with the degree, and with the size of the cells at the order of the degree plus one
(L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapter 8).  The training
runs only tell between which inputs: the equations are solved in all of that box.  Online none is.
"""

import math
import time
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.polynomial import chebyshev
from pydantic import Field

from vehiclemor.arguments import check_distinct_indices, check_indices, check_shapes, require
from vehiclemor.codegen.derivatives import JacobianProduct, jacobian_product
from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Prepared, Ready, address_of_array, ready
from vehiclemor.codegen.operations import MOST_SIZE, Kernel, Listing, Value, padded
from vehiclemor.exceptions import InputError, UnreachableError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import Method, OfflineCost, offline_cost
from vehiclemor.reduction.map_loops import Cells
from vehiclemor.reduction.reduced_system import ReducedMechanism
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.trust import trust_of
from vehiclemor.simulation.algebraic import AlgebraicModel, kinematic_loop
from vehiclemor.simulation.checks import loop_array
from vehiclemor.simulation.evaluation import By, address_of
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.newton_loops import Samples
from vehiclemor.simulation.run_timer import timed
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust
from vehiclemor.simulation.workspaces import Pool

# Above this degree, powers lose digits to rounding.
HIGHEST_DEGREE = 20
# Solved positions that a fit may ask for.
MOST_NODES = 300_000
# Part of an input's range in training that is added at either end: its peaks lie between samples.
MARGIN = 0.005
# An input that changes by less (m) rests; runs may leave the ranges by as much.
RESTING = 1e-9
# Quantities (rad or m) that differ by less are one, such as an output that is a coordinate.
SAME = 1e-15


def monomials(rank: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Monomials up to a total degree in `rank` variables, each as its variables in order.

    The constant, (), comes first, then (0,), (1,) and so on, then (0, 0), (0, 1) and so on.
    """
    orders = range(degree + 1)
    return tuple(c for n in orders for c in combinations_with_replacement(range(rank), n))


def map_kernel(moving: tuple[int, ...], degree: int, columns: tuple[int, ...]) -> Kernel:
    """The kernel `polynomials`: each monomial is one of a degree less times a variable.

    The variables are the moving inputs; several results may share a column of the coefficients.
    """
    listing = Listing()
    x = [listing.let(listing.entry("_x", i)) for i in moving]
    powers: dict[tuple[int, ...], Value] = {(): listing.number(1.0)}
    for term in monomials(len(moving), degree)[1:]:
        powers[term] = listing.let(powers[term[:-1]] * x[term[-1]])
    values = listing.sums("_coefficients", 0, max(columns) + 1, [*powers.values()])
    for index, column in enumerate(columns):
        listing.store(index, values[column])
    return listing.kernel("polynomials", ("_x", "_coefficients", "_result"))


class PathMapSettings(Settings):
    """Settings for a kinematic model."""

    degree: int = Field(3, ge=1, description="total degree of the polynomials in a cell")
    cells: int = Field(16, ge=1, description="equal cells along each input that moves in training")


@dataclass(frozen=True)
class PathMapModel(ReducedMechanism):
    """Coordinates and outputs as polynomials, of that total degree, of the inputs that move."""

    model: AlgebraicModel
    # Lowest and highest value (inputs, 2) of each input in training, with the margins.
    ranges: np.ndarray
    moving: tuple[int, ...]
    degree: int
    cells: Cells
    # Column of the coefficients for each coordinate and output; equal ones share one.
    columns: tuple[int, ...]
    offline: OfflineCost

    def check_sizes(self) -> None:
        """Raise `ValueError` if the loop would read beyond inputs, cells or columns."""
        inputs, cells = len(self.model.inputs), self.cells
        require(len(cells.numbers) == inputs, "cells")
        check_shapes("ranges", (self.ranges, inputs, 2))
        require(bool(np.isfinite(self.ranges).all()), "ranges")
        check_distinct_indices("moving", self.moving, inputs)
        require(0 <= self.degree <= HIGHEST_DEGREE, "degree")
        require(
            len(self.columns) == len(self.model.coordinates) + len(self.model.outputs), "columns"
        )
        check_indices("columns", self.columns, len(self.columns))
        terms = math.comb(len(self.moving) + self.degree, self.degree)
        width = padded(max(self.columns) + 1)
        require(cells.coefficients.shape[1:] == (terms, width), "coefficients")
        # The kernel grows with them.
        require(bool(self.moving) and terms * width <= MOST_SIZE, "degree")

    @property
    def order(self) -> int:
        """Number of inputs that move."""
        return len(self.moving)

    @cached_property
    def _kernel(self) -> Kernel:
        return map_kernel(self.moving, self.degree, self.columns)

    @cached_property
    def _polynomials(self) -> np.ndarray:
        """Address of the compiled kernel."""
        return np.array([address_of(Kernels([self._kernel]), self._kernel.name)])

    @cached_property
    def _pool(self) -> Pool[Prepared]:
        return Pool()

    def _packed(self, given: Ready, size: int) -> Prepared:
        """The loop for some inputs, to be given space of that size."""
        loop = kinematic_loop("map_path", "reduction.map_loops")
        columns = len(self.columns)
        call = loop.prepared(given, self.cells, self._polynomials, columns, np.empty(0))
        call.words[call.address("space") + 1] = size
        return call

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """Polynomials at the maneuver's output times."""
        self.model.check_start(start)
        return self._evaluated(*self.model.sampled(maneuver))

    def solved(self, time: float, inputs: np.ndarray, state: np.ndarray) -> Trajectory:
        """Polynomials at one time: a step is an evaluation."""
        del state
        return self._evaluated(np.array([time]), inputs, ready(Samples(inputs)))

    @cached_property
    def _jacobian(self) -> JacobianProduct:
        kernel = self._kernel
        return jacobian_product(kernel, kernel.arguments[0], len(self.columns), len(self.ranges))

    def slopes(self, state: np.ndarray, inputs: np.ndarray, by: By, of: str) -> np.ndarray:
        """Derivatives of coordinates, or of the model's outputs there, by the inputs."""
        if by != "inputs" or of not in ("coordinates", "outputs"):
            raise InputError("path_map: derivatives are of coordinates or outputs, by inputs")
        cells = self.cells
        within = ((inputs - cells.centres) * cells.scales + 1.0) * cells.halves
        indices = np.clip(within, 0.0, cells.tops).astype(int)
        cell = np.ravel_multi_index(tuple(indices), tuple(cells.numbers))
        arrays = 2.0 * (within - indices) - 1.0, cells.coefficients[cell].ravel()
        table = self._jacobian.jacobian(arrays) * (2.0 * cells.halves * cells.scales)
        moved = table[: len(self.model.coordinates)]
        if of == "coordinates":
            return moved
        direct = self.model.jacobian_of(of, state, inputs, "inputs")
        return direct + self.model.jacobian_of(of, state, inputs, "state") @ moved

    def _evaluated(self, times: np.ndarray, inputs: np.ndarray, given: Ready) -> Trajectory:
        """Polynomials at inputs (samples, inputs), also as the loop takes them."""
        model, samples = self.model, len(times)
        size = samples * len(self.columns)
        space = np.empty(size + inputs.shape[1])
        call = self._pool.taken(given, lambda: self._packed(given, len(space)))
        call.words[call.address("space")] = address_of_array(space)
        _, seconds = timed(call)
        self._pool.give_back(given, call)
        table = space[:size].reshape(samples, -1)
        n = len(model.coordinates)
        return Trajectory.of(
            times=times,
            inputs=inputs,
            coordinates=table[:, :n],
            speeds=table[:, :0],
            outputs=table[:, n:],
            counts=dict.fromkeys(model.counts, 0),
            seconds=seconds,
            names=model.outputs,
            model=model,
        )

    def trust(self, states: np.ndarray, inputs: np.ndarray) -> Trust:
        """How far inputs (samples, inputs) go in the ranges."""
        del states
        used = (inputs - self.cells.centres) * self.cells.scales
        names = [f"input {name}" for name in self.model.inputs]
        return trust_of(np.zeros(len(inputs)), used, names)

    def for_model(self, model: AlgebraicModel) -> "PathMapModel":
        """The map of another mechanism, between the same inputs."""
        number = int(self.cells.numbers.max())
        return _mapped(model, self.ranges, self.degree, number)


def check(model: Model, settings: PathMapSettings) -> None:
    """Raise `InputError` if the degree is too high for powers, or the nodes are too many."""
    if settings.degree > HIGHEST_DEGREE:
        raise InputError(f"degree {settings.degree} is above {HIGHEST_DEGREE}")
    nodes = (settings.cells * (settings.degree + 1)) ** len(model.inputs)
    if nodes > MOST_NODES:
        raise InputError(
            f"{settings.cells} cells of degree {settings.degree} need {nodes} solved positions; "
            f"at most {MOST_NODES}"
        )


def fit(model: AlgebraicModel, training: Training, settings: PathMapSettings) -> PathMapModel:
    """Interpolation of positions that are solved at the Chebyshev points of all cells.

    `InputError` if no input moves in training, or not all of the box that they span is in reach.
    """
    every = np.concatenate([model.sampled(run.maneuver)[1] for run in training])
    low, high = every.min(axis=0), every.max(axis=0)
    margins = MARGIN * (high - low)
    ranges = np.column_stack([low - margins, high + margins])
    return _mapped(model, ranges, settings.degree, settings.cells)


def _mapped(model: AlgebraicModel, ranges: np.ndarray, degree: int, number: int) -> PathMapModel:
    """The map of a mechanism between the ranges (inputs, 2), in so many cells along each input."""
    began = time.process_time()
    centres, widths = ranges.mean(axis=1), np.ptp(ranges, axis=1)
    moving = np.flatnonzero(widths > RESTING)
    if not len(moving):
        raise InputError("path_map: no input moves in training")
    shares = (
        np.arange(number)[:, None] + 0.5 + 0.5 * chebyshev.chebpts1(degree + 1)
    ).ravel() / number
    grid = [low + shares * (high - low) for low, high in ranges[moving]]
    inputs = np.tile(centres, (len(grid[0]) ** len(grid), 1))
    inputs[:, moving] = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, len(grid))
    try:
        solved = model.solve_path(np.zeros(len(inputs)), inputs)
    except UnreachableError:
        sides = zip(model.definition.inputs, ranges, strict=True)
        box = ", ".join(f"{q.name} {low:.5g} to {high:.5g} {q.unit}" for q, (low, high) in sides)
        raise InputError(f"path_map: what training spans is not all in reach: {box}") from None
    numbers = np.where(widths > RESTING, number, 1)
    values, columns = _distinct(np.hstack([solved.coordinates, solved.outputs]))
    cells = Cells(
        centres,
        1.0 / np.maximum(0.5 * widths, RESTING),
        numbers,
        _coefficients(values, len(moving), number, degree),
    )
    cost = offline_cost(began, model, [solved])
    varied = tuple(moving.tolist())
    return PathMapModel(model, ranges, varied, degree, cells, columns, cost)


def _distinct(values: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """Columns (nodes, columns) that differ, and which of them stands for each of the values."""
    from scipy.spatial.distance import cdist

    first_alike = (cdist(values.T, values.T, "chebyshev") < SAME).argmax(axis=1)
    different, indices = np.unique(first_alike, return_inverse=True)
    return values[:, different], tuple(indices.tolist())


def _coefficients(values: np.ndarray, moving: int, number: int, degree: int) -> np.ndarray:
    """Coefficients (cells, monomials, quantities) from values (nodes, quantities) of all cells."""
    size, quantities = degree + 1, values.shape[1]
    # Along each input cells and, in each of these, nodes.
    grid = values.reshape(*[number, size] * moving, quantities)
    grid = np.moveaxis(grid, range(0, 2 * moving, 2), range(moving))
    cells = grid.reshape(number**moving, *[size] * moving, quantities)
    # Chebyshev series first: they say what to leave out, and are well-conditioned.
    to_series = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(size), degree))
    for axis in range(1, moving + 1):
        cells = _along(to_series, cells, axis)
    orders = np.indices([size] * moving).sum(axis=0)
    cells[:, orders > degree] = 0.0
    to_powers = np.zeros((size, size))
    for order in range(size):
        to_powers[: order + 1, order] = chebyshev.cheb2poly(np.eye(size)[order])
    for axis in range(1, moving + 1):
        cells = _along(to_powers, cells, axis)
    terms = [np.array(term, dtype=int) for term in monomials(moving, degree)]
    powers = np.array([np.bincount(term, minlength=moving) for term in terms])
    coefficients = cells[:, *powers.T]
    padding = padded(quantities) - quantities
    return loop_array(np.pad(coefficients, ((0, 0), (0, 0), (0, padding))))


def _along(matrix: np.ndarray, values: np.ndarray, axis: int) -> np.ndarray:
    """Products with a matrix along one axis."""
    return np.moveaxis(np.tensordot(matrix, values, (1, axis)), 0, axis)


METHOD = Method(
    name="path_map",
    summary="coordinates and outputs as polynomials of the inputs: no equation is solved",
    reference="10.1137/1.9781611975949",
    settings={"ae": PathMapSettings},
    check=check,
    fit=fit,
    learns_from="inputs",
)

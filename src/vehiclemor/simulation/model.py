"""What every model offers, whatever its kind."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from vehiclemor.maneuvers import Maneuver
from vehiclemor.parameters import ParameterSet
from vehiclemor.simulation.trajectory import Start, Trajectory


class Model(Protocol):
    """A model ready to run, as studies, methods and reports see it.

    A state is the coordinates and, after them, the speeds; kinematic models have no speeds.
    """

    @property
    def name(self) -> str:
        """Registered name."""
        ...

    @property
    def summary(self) -> str:
        """One line."""
        ...

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        ...

    @property
    def equations(self) -> Any:
        """Named quantities `coordinates`, `inputs`, `outputs` and, if there are any, `speeds`."""
        ...

    @property
    def parameters(self) -> ParameterSet:
        """Validated parameter set."""
        ...

    @property
    def kernel_hash(self) -> str:
        """Hash of the kernels' source and of the compiler's versions."""
        ...

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        ...

    @property
    def speeds(self) -> tuple[str, ...]:
        """Names of the speeds."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        ...

    @property
    def starts(self) -> tuple[str, ...]:
        """Names of the initial conditions, the default first."""
        ...

    @property
    def counts(self) -> Mapping[str, str]:
        """What its solvers count: name -> meaning."""
        ...

    @property
    def evaluations(self) -> str:
        """Name of the count that tells how often its equations were evaluated."""
        ...

    @cached_property
    def operation_counts(self) -> dict[str, dict[str, int]]:
        """Operations of each generated function, by kind and in total."""
        ...

    def start(self, name: Start) -> np.ndarray:
        """State (n,) of an initial condition, or the one given; `InputError` if it is neither."""
        ...

    def simulate(
        self,
        maneuver: Maneuver,
        start: Start | None = None,
        times: np.ndarray | None = None,
        solver: str | None = None,
        tolerance: float | None = None,
    ) -> Trajectory:
        """Full-order solution; where None, the model's first start, output times and defaults."""
        ...

    def outputs_at(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (samples, number of outputs) along a path of states and inputs."""
        ...

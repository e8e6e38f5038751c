"""Exported C, compiled as a user would, and what it must give."""

import subprocess
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

import vehiclemor as vm
from vehiclemor.reduction.reduced_model import ReducedOrderModel

# Strict, and quick to compile.
FLAGS = ("-std=c99", "-Wall", "-Werror", "-pedantic", "-O0")


def compiled(folder: Path) -> Path:
    """The driver of an exported folder, as a program."""
    # The driver needs no derivatives; those are compiled with the units.
    sources = [f"vehiclemor_{part}.c" for part in ("model", "step", "driver")]
    command = ["cc", *FLAGS, "-o", "driver", *sources, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "driver"


def driven(driver: Path, inputs: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Derivative at the start, and rows of states and outputs along inputs (samples, inputs)."""
    rows = [f"{len(inputs) - 1} {step!r}", *(" ".join(map(repr, u)) for u in inputs.tolist())]
    text = subprocess.run(
        [driver], input="\n".join(rows), capture_output=True, text=True, check=True
    ).stdout
    first, *others = text.splitlines()
    return np.array(first.split(), float), np.array([row.split() for row in others], float)


def runge_kutta(rates, state, inputs, step, held=1) -> np.ndarray:
    """States along inputs by the classical method, linear between samples or held for steps.

    Parameters
    ----------
    held
        Steps that an input is held for; 1: it goes to the next one linearly.
    """
    states = [state]
    for u, following in pairwise(inputs):
        for _ in range(held):
            end = following if held == 1 else u
            x, middle = states[-1], 0.5 * (u + end)
            k1 = rates(x, u)
            k2 = rates(x + 0.5 * step * k1, middle)
            k3 = rates(x + 0.5 * step * k2, middle)
            k4 = rates(x + step * k3, end)
            states.append(x + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
    return np.array(states)


@cache
def in_use(name: str, kind: str) -> ReducedOrderModel:
    """The full model behind the names of a reduced one, or the reduced one that ships."""
    return vm.rom(name) if kind == "reduced" else vm.reduce(name, "full_order")


def relative(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest error of a column as a part of its largest value, or of 1e-3 if that is smaller."""
    return float((np.abs(found - wanted).max(0) / np.maximum(np.abs(wanted).max(0), 1e-3)).max())


def steering(model: ReducedOrderModel, samples: int, step: float) -> np.ndarray:
    """Inputs (samples, inputs) of a turn: a sine, and its derivatives where they are inputs."""
    t, size, rate = np.arange(samples) * step, 0.02, 3.0
    kinds = [np.sin(rate * t), rate * np.cos(rate * t), -(rate**2) * np.sin(rate * t)]
    return size * np.column_stack(kinds[: len(model.inputs)])

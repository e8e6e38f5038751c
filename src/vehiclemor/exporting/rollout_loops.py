"""Fixed steps of many runs, compiled; kernels take `LANES` runs at once."""

from vehiclemor.codegen.loop_types import (
    Cube,
    Float,
    Int,
    IntVector,
    Matrix,
    Vector,
    call_lanes,
)
from vehiclemor.codegen.operations import LANES

# Kernels by their index in the list of addresses; without the last one steps are explicit.
RATES, OUTPUTS, SOLVE = range(3)
# What work holds: states, rates, increments of the stages, inputs at the end of a stage, outputs.
STATE, STAGE, RATE, FIRST, SECOND, INPUTS, RESULT = range(7)
VECTORS = 7


def rollouts(
    states: Matrix,
    inputs: Cube,
    kernels: IntVector,
    constants: Vector,
    period: Float,
    steps: Int,
    work: Cube,
    results: Cube,
) -> Int:
    """Outputs (runs, samples, outputs) at the samples of inputs (runs, samples, inputs).

    Runs are `LANES` at least.  Between samples, a period apart, inputs are linear, and there are
    so many steps.
    """
    runs, samples, outputs = results.shape
    x = work[STATE]
    for group in range(0, runs, LANES):
        # The last runs overlap those before.
        first = min(group, runs - LANES)
        for lane in range(LANES):
            for i in range(states.shape[1]):
                x[lane, i] = states[first + lane, i]
        for sample in range(samples):
            if sample:
                for step in range(steps):
                    part = sample - 1, step / steps, (step + 1) / steps
                    take_step(inputs, first, part, kernels, constants, period / steps, work)
            inputs_at(inputs, first, sample, 0.0, work[INPUTS])
            call_lanes(kernels, OUTPUTS, x, work[INPUTS], constants, work[RESULT], 0)
            for lane in range(LANES):
                for i in range(outputs):
                    results[first + lane, sample, i] = work[RESULT, lane, i]
    return 0


def take_step(inputs, first, part, kernels, constants, h, work):
    """Take the states over a step between two parts of the time after a sample."""
    if kernels[SOLVE]:
        implicit_step(inputs, first, part, kernels, constants, h, work)
    else:
        explicit_step(inputs, first, part, kernels, constants, h, work)


def explicit_step(inputs, first, part, kernels, constants, h, work):
    """The classical Runge-Kutta method of order 4."""
    sample, begin, end = part
    x, stage, rate, new, u = work[STATE], work[STAGE], work[RATE], work[FIRST], work[INPUTS]
    inputs_at(inputs, first, sample, begin, u)
    call_lanes(kernels, RATES, x, u, constants, rate, 0)
    add(x, h / 6.0, rate, new)
    add(x, h / 2.0, rate, stage)
    inputs_at(inputs, first, sample, 0.5 * (begin + end), u)
    call_lanes(kernels, RATES, stage, u, constants, rate, 0)
    add(new, h / 3.0, rate, new)
    add(x, h / 2.0, rate, stage)
    call_lanes(kernels, RATES, stage, u, constants, rate, 0)
    add(new, h / 3.0, rate, new)
    add(x, h, rate, stage)
    inputs_at(inputs, first, sample, end, u)
    call_lanes(kernels, RATES, stage, u, constants, rate, 0)
    add(new, h / 6.0, rate, x)


def implicit_step(inputs, first, part, kernels, constants, h, work):
    """The linearly implicit method of `exporting.ros2`."""
    sample, begin, end = part
    x, stage, rate, u = work[STATE], work[STAGE], work[RATE], work[INPUTS]
    one, other = work[FIRST], work[SECOND]
    inputs_at(inputs, first, sample, begin, u)
    call_lanes(kernels, RATES, x, u, constants, rate, 0)
    call_lanes(kernels, SOLVE, x, rate, constants, one, 0)
    add(x, h, one, stage)
    inputs_at(inputs, first, sample, end, u)
    call_lanes(kernels, RATES, stage, u, constants, rate, 0)
    add(rate, -2.0, one, rate)
    call_lanes(kernels, SOLVE, x, rate, constants, other, 0)
    add(x, 1.5 * h, one, x)
    add(x, 0.5 * h, other, x)


def add(vectors, factor, others, into):
    """The sum of vectors and a factor times others, of all lanes."""
    for lane in range(LANES):
        for i in range(into.shape[1]):
            into[lane, i] = vectors[lane, i] + factor * others[lane, i]


def inputs_at(inputs, first, sample, part, into):
    """Inputs of the runs when a part of the time from a sample to the next has passed."""
    following = min(sample + 1, inputs.shape[1] - 1)
    for lane in range(LANES):
        for i in range(inputs.shape[2]):
            before, after = inputs[first + lane, sample, i], inputs[first + lane, following, i]
            into[lane, i] = before + part * (after - before)

"""JAX with diffrax: batches by `vmap`; the processor is asked for, not a graphics card.

Only the explicit method: to compile an implicit one for a whole car takes minutes.
"""

from functools import partial
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from clock import Case, Curve, pulse

import vehiclemor as vm
from vehiclemor.inputs import steering

jax.config.update("jax_platforms", "cpu")
jax.config.update("jax_enable_x64", True)


def batch(case: Case) -> dict[str, Curve]:
    """Tsit5 by tolerance and by step size, both arguments of what is compiled once."""
    function, racked = vm.export(case.model, "jax"), len(case.model.inputs) > 1
    times, start = jnp.array(case.maneuver.times), jnp.array(case.start)
    signals, scale = case.more["signals"], jnp.array(case.model.error_scale)
    factors = jnp.array([(s.frequency_factor, s.amplitude_factor) for s in signals])
    save = diffrax.SaveAt(ts=times, fn=lambda t, x, args: x[case.lateral])  # noqa: ARG005

    def rates(t: Any, x: Any, args: Any) -> Any:
        end = steering.BEGIN + steering.LANE_CHANGE_LENGTH / args[0]
        # The pulse is continuous where it is clipped, so that no step need end there.
        clipped = jnp.clip(t, steering.BEGIN, end)
        return function(x, jnp.array(pulse(clipped, jnp, racked, args[1], args[0])))[0]

    def single(args: Any, tolerance: Any, fixed: bool) -> Any:
        control: Any = diffrax.PIDController(rtol=tolerance, atol=tolerance * scale)
        return diffrax.diffeqsolve(
            *(diffrax.ODETerm(rates), diffrax.Tsit5(), 0.0, times[-1]),
            *(tolerance if fixed else None, start, args),
            saveat=save,
            stepsize_controller=diffrax.ConstantStepSize() if fixed else control,
            max_steps=100_000,
        ).ys

    def curve(fixed: bool, tolerances: list[float]) -> Curve:
        compiled = jax.jit(jax.vmap(partial(single, fixed=fixed), (0, None)))
        make = lambda tolerance: lambda: np.asarray(compiled(factors, tolerance))  # noqa: E731
        return Curve(make, tolerances, np.asarray, "lateral position")

    return {
        "JAX diffrax Tsit5, by tolerance": curve(False, [1e-4, 1e-6]),
        "JAX diffrax Tsit5, equal steps": curve(True, [1e-2, 5e-3]),
    }

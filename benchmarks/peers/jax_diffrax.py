"""JAX with diffrax: batches by `vmap`; the processor is asked for, not a graphics card.

Only an explicit method: Kvaerno5 took minutes to compile for the 14-DOF car, and was slower at the
same error.
"""

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
    """Tsit5, compiled once: the tolerance is an argument."""
    function, scale = vm.export(case.model, "jax"), jnp.array(case.model.error_scale)
    times, start = jnp.array(case.maneuver.times), jnp.array(case.start)
    factors = jnp.array([(s.frequency_factor, s.amplitude_factor) for s in case.more])
    save = diffrax.SaveAt(ts=times, fn=lambda t, x, args: x[case.lateral])  # noqa: ARG005

    def rates(t: Any, x: Any, args: Any) -> Any:
        end = steering.BEGIN + steering.LANE_CHANGE_LENGTH / args[0]
        # The pulse is continuous where it is clipped, so that no step need end there.
        clipped = jnp.clip(t, steering.BEGIN, end)
        return function(x, jnp.array(pulse(clipped, jnp, case.racked, args[1], args[0])))[0]

    def single(args: Any, tolerance: Any) -> Any:
        return diffrax.diffeqsolve(
            *(diffrax.ODETerm(rates), diffrax.Tsit5(), 0.0, times[-1], None, start, args),
            saveat=save,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance * scale),
            max_steps=100_000,
        ).ys

    compiled = jax.jit(jax.vmap(single, (0, None)))
    make = lambda tolerance: lambda: np.asarray(compiled(factors, tolerance))  # noqa: E731
    return {"JAX diffrax Tsit5": Curve(make, (1e-4, 1e-6), delivers="lateral position")}

"""MuJoCo: a scene of comparable size, since it can represent none of the models.

It has no tire model but friction, and its constraints and contacts are soft.
"""

from collections.abc import Callable

import mujoco

STEP, SECONDS = 0.002, 2.0
WHEEL = """
<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1" stiffness="25000" damping="2500"/>
<geom type="sphere" size="0.05" mass="20" contype="0" conaffinity="0"/>
<body><joint type="hinge" axis="0 1 0"/>
<geom type="ellipsoid" size="0.3 0.1 0.3" mass="20" friction="1"/></body></body>"""
SCENE = """
<mujoco><option timestep="{step}" integrator="implicitfast"/>
<worldbody><geom type="plane" size="0 0 1"/>
<body pos="0 0 0.35"><freejoint/>
<geom type="box" size="2 0.7 0.2" pos="0 0 0.3" mass="1400" contype="0" conaffinity="0"/>
{wheels}</body></worldbody></mujoco>"""


def context() -> dict[str, tuple[Callable[[], object], float, str]]:
    """Label -> call, simulated seconds, and what it is."""
    wheels = "".join(WHEEL.format(x=x, y=y) for x in (1.3, -1.3) for y in (0.75, -0.75))
    model = mujoco.MjModel.from_xml_string(SCENE.format(step=STEP, wheels=wheels))
    data = mujoco.MjData(model)

    def roll() -> None:
        mujoco.mj_resetData(model, data)
        data.qvel[0] = 20.0
        data.qvel[7::2] = 20.0 / 0.3
        mujoco.mj_step(model, data, round(SECONDS / STEP))

    what = f"car of {model.nv} degrees of freedom that rolls straight on, friction, 2 ms steps"
    return {"MuJoCo": (roll, SECONDS, what)}

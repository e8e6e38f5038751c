"""Coordinates, inputs, outputs and equations of the double-wishbone suspension by name."""

from vehiclemor.multibody.quantities import Quantity

COORDINATES = (
    Quantity("zeta", "rad", "first 3-2-1 Euler angle of the wheel carrier (about z)"),
    Quantity("eta", "rad", "second 3-2-1 Euler angle of the wheel carrier (about y)"),
    Quantity("xi", "rad", "third 3-2-1 Euler angle of the wheel carrier (about x)"),
    Quantity("theta_u", "rad", "rotation of the upper control arm"),
    Quantity("theta_l", "rad", "rotation of the lower control arm"),
    Quantity("alpha", "rad", "rotation of the tie rod's universal joint about z"),
    Quantity("beta", "rad", "rotation of the tie rod's universal joint about the rotated x axis"),
    Quantity("s", "m", "rack displacement, positive to the left"),
)
INPUTS = (
    Quantity("z", "m", "height of the wheel centre above its design position"),
    Quantity("s0", "m", "prescribed rack displacement, positive to the left"),
)
OUTPUTS = (
    Quantity("spindle_x", "m", "spindle displacement in x"),
    Quantity("spindle_y", "m", "spindle displacement in y"),
    Quantity("second_euler_angle", "rad", "second Euler angle of the wheel carrier"),
    Quantity("toe", "rad", "toe angle of the left wheel, positive when steered to the left"),
    Quantity("camber", "rad", "inclination of the left wheel's spin axis, positive upwards"),
    Quantity("rack", "m", "rack displacement"),
)
EQUATIONS = (
    Quantity("lower_ball_joint_x", "m", "closure of the lower ball joint in x"),
    Quantity("lower_ball_joint_y", "m", "closure of the lower ball joint in y"),
    Quantity("lower_ball_joint_z", "m", "closure of the lower ball joint in z"),
    Quantity("tie_rod_x", "m", "closure of the outer tie-rod joint in x"),
    Quantity("tie_rod_y", "m", "closure of the outer tie-rod joint in y"),
    Quantity("tie_rod_z", "m", "closure of the outer tie-rod joint in z"),
    Quantity("wheel_height", "m", "prescribed wheel-centre height"),
    Quantity("rack_displacement", "m", "prescribed rack displacement"),
)
# Moving points that a drawing of the mechanism needs, beside the fixed pivots.
JOINTS = (
    "upper_ball_joint",
    "lower_ball_joint",
    "tie_rod_inner",
    "tie_rod_outer",
    "wheel_centre",
    "axle_direction",
)

"""A driver with preview in the double lane change of ISO 3888-1, at the wheel of any car model.

One driver drives the full car and the reduced one.  In a closed loop a model's error comes back to
it through the driver, who corrects the place but sees another car.
"""

import numpy as np

import vehiclemor as vm
from vehiclemor.reduction.reduced_model import ReducedOrderModel as Car

# Ends in m of the way over to the other lane and of the way back (ISO 3888-1: sections of 15, 30,
# 25, 25, 15 and 15 m), and distance in m between the lanes.
OVER, BACK, LENGTH, OFFSET = (15.0, 45.0), (70.0, 95.0), 125.0, 3.5
# Preview time of the driver in s, frequency of the steering system in 1/s.
PREVIEW, FREQUENCY = 0.85, 30.0
SEEN = ("longitudinal_position", "lateral_position", "yaw")


def lane(x: float) -> float:
    """Lateral position (m) of the line to follow, smooth to the second derivative."""
    z = np.clip([(x - begin) / (end - begin) for begin, end in (OVER, BACK)], 0.0, 1.0)
    over, back = z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    return OFFSET * (over - back)


def steering_per_curvature(car: Car, state: np.ndarray, speed: float) -> float:
    """Steering (rad or m) that holds a curve of 1 1/m, from a bend that is nearly none."""
    small = np.zeros(len(car.inputs))
    small[0] = 1e-4
    yaw = car.output_names.index("yaw")
    bend = car.step(state, small, 3.0)
    later = car.step(bend, small, 0.5)
    turned = car.outputs(later, small)[yaw] - car.outputs(bend, small)[yaw]
    return small[0] * speed * 0.5 / turned


def drive(car: Car, start: np.ndarray, speed: float, dt: float = 0.01) -> tuple[np.ndarray, float]:
    """Outputs (samples, outputs) of a car that the driver steers along the lanes; its trust."""
    gain = steering_per_curvature(car, car.state(start), speed)
    state, steering, rate, known = car.state(start), 0.0, 0.0, 0.0
    u, ahead = np.zeros(len(car.inputs)), PREVIEW * speed
    seen, outputs = [car.output_names.index(name) for name in SEEN], [car.outputs(state, u)]
    while outputs[-1][seen[0]] < LENGTH:
        x, y, yaw = outputs[-1][seen]
        # The circle through the point ahead, seen from the car.
        aside = lane(x + ahead) - y - ahead * np.sin(yaw)
        wanted = gain * 2.0 * aside / ahead**2
        # The steering follows with a delay: critically damped, of the second order.
        pushed = FREQUENCY**2 * (wanted - steering) - 2.0 * FREQUENCY * rate
        begins = (steering, rate, pushed)
        steering += dt * rate + 0.5 * dt**2 * pushed
        rate += dt * pushed
        # A car takes the steering alone, or its derivatives too.
        u, ends = (np.array(v[: len(u)]) for v in (begins, (steering, rate, pushed)))
        state = car.step(state, u, dt, next_inputs=ends)
        outputs.append(car.outputs(state, ends))
        known = max(known, car.trust(state, ends).indicator)
    return np.array(outputs), known


def main() -> None:
    """Drive the full and the reduced cars at 80 km/h, and print how far they are apart."""
    speed = 80.0 / 3.6
    for name in ("independent_suspension_vehicle", "high_fidelity_vehicle"):
        reduced = vm.rom(name)
        full = vm.reduce(reduced.model, "full_order")
        start = vm.model(name, parameters={"initial_speed": speed}).start()
        (expected, _), (found, known) = (drive(car, start, speed) for car in (full, reduced))
        samples = min(len(found), len(expected))
        off = np.abs(found[:samples] - expected[:samples]).max(axis=0)
        print(f"{name}, {reduced.method}: indicator {known:.2f} (trusted up to 1)")
        for output in (*SEEN, "lateral_speed", "roll"):
            column = full.output_names.index(output)
            size = np.abs(expected[:, column]).max()
            print(f"  {output:22} up to {size:8.3g}, apart by {off[column]:.2g} at most")


if __name__ == "__main__":
    main()

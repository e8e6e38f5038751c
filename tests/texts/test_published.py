"""The published numbers are those of the paper."""

from claims import claims

from vehiclemor.report.published import load_published

# Prefix of ids -> model.
PREFIXES = {
    "gv": "independent_suspension_vehicle",
    "dw": "double_wishbone",
    "hfv": "high_fidelity_vehicle",
    "all": None,
}
ANGLE = "second_euler_angle"

# Typed from the paper, not from the file. id -> value, unit, quantity, page, figure; then states,
# control period and snapshots behind the number, as far as the paper prints them.
NUMBERS = {
    "gv_rms_pitch": (5.18e-4, "rad", "pitch", "031007-3", 4, 3, 0.5, None),
    "gv_rms_yaw": (7.59e-5, "rad", "yaw", "031007-3", 4, 3, 0.5, None),
    "gv_time_reduction": (0.20, "1", "", "031007-4", None, 3, 0.5, None),
    "dw_rms_spindle_y": (7.57e-5, "m", "spindle_y", "031007-4", 7, 3, 5.0, 10),
    "dw_rms_second_euler_angle": (2.4e-5, "rad", ANGLE, "031007-4", 7, 3, 5.0, 10),
    "dw_time_reduction_3": (0.65, "1", "", "031007-4", None, 3, 5.0, 10),
    "dw_time_reduction_6": (0.50, "1", "", "031007-7", 14, 6, None, None),
    "hfv_rms_lateral_speed": (0.0198, "m/s", "lateral_speed", "031007-5", 10, 1, 0.1, 5),
    "hfv_rms_vertical_speed": (0.0143, "m/s", "vertical_speed", "031007-5", 10, 1, 0.1, 5),
    "hfv_time_reduction": (0.23, "1", "", "031007-5", None, 1, 0.1, 5),
}


def test_numbers_are_as_printed_and_all_of_them_are_tested() -> None:
    published = load_published()
    kinds = ("rms_error", "time_reduction")
    assert {n.id for n in published.values() if n.kind in kinds} == set(NUMBERS)
    for name, expected in NUMBERS.items():
        n = published[name]
        behind = n.states, n.control_period, n.snapshots
        assert (n.value, n.unit, n.quantity, n.page, n.figure, *behind) == expected, name
        assert n.kind == ("rms_error" if "_rms_" in name else "time_reduction"), name
    for entry in (*published.values(), *claims().values()):
        assert entry.model == PREFIXES[entry.id.partition("_")[0]]

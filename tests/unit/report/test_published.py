"""Printed numbers and claims: present, as printed, and guarded by one clear line."""

import pytest

from vehiclemor.exceptions import FileError
from vehiclemor.report.published import load_published
from vehiclemor.resources import data_folder

# Prefix of ids -> model.
MODELS = {
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

# id -> value, unit, page.
SETTINGS = {
    "gv_wheels": (4, "1", "031007-3"),
    "gv_lumped_masses": (4, "1", "031007-3"),
    "gv_lumped_mass_share": (0.25, "1", "031007-3"),
    "gv_degrees_of_freedom": (14, "1", "031007-3"),
    "gv_initial_speed": (20, "m/s", "031007-3"),
    "gv_wheel_torque": (0, "N m", "031007-3"),
    "gv_duration": (25, "s", "031007-3"),
    "gv_control_period": (0.5, "s", "031007-3"),
    "gv_states_full": (14, "1", "031007-4"),
    "gv_states_reduced": (3, "1", "031007-4"),
    "dw_degrees_of_freedom": (1, "1", "031007-4"),
    "dw_input_amplitude": (0.1, "m", "031007-4"),
    "dw_input_frequency": (0.1, "Hz", "031007-4"),
    "dw_duration": (10, "s", "031007-4"),
    "dw_states_full": (8, "1", "031007-4"),
    "dw_states_reduced": (3, "1", "031007-4"),
    "dw_control_period": (5, "s", "031007-4"),
    "dw_snapshots": (10, "1", "031007-4"),
    "dw_fig11_frequency_increase": (0.2, "1", "031007-5"),
    "dw_fig12_amplitude_increase": (0.2, "1", "031007-5"),
    "dw_fig14_frequency_increase": (1.0, "1", "031007-7"),
    "dw_fig14_states_few": (3, "1", "031007-7"),
    "dw_fig14_states_many": (6, "1", "031007-7"),
    "hfv_coordinates": (26, "1", "031007-5"),
    "hfv_constraints": (12, "1", "031007-5"),
    "hfv_degrees_of_freedom": (14, "1", "031007-5"),
    "hfv_initial_speed": (20, "m/s", "031007-5"),
    "hfv_states_reduced": (1, "1", "031007-5"),
    "hfv_control_period": (0.1, "s", "031007-5"),
    "hfv_snapshots": (5, "1", "031007-5"),
}


def test_numbers_are_as_printed_and_all_of_them_are_tested() -> None:
    published = load_published()
    assert set(published.numbers) == set(NUMBERS) | set(SETTINGS)
    for name, expected in NUMBERS.items():
        n = published.numbers[name]
        behind = n.states, n.control_period, n.snapshots
        assert (n.value, n.unit, n.quantity, n.page, n.figure, *behind) == expected, name
        assert n.kind == ("rms_error" if "_rms_" in name else "time_reduction"), name
    for name, expected in SETTINGS.items():
        n = published.numbers[name]
        assert n.kind in ("setting", "perturbation"), name
        assert (n.value, n.unit, n.page) == expected, name
    for entry in (*published.number, *published.claim):
        assert entry.model == MODELS[entry.id.partition("_")[0]]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("value = 5.18e-4", "value = nan", "number.10.value"),
        ("figure = 4", "figure = 15", "number.10.figure"),
        ("figure = 4", "colour = 1", "number.10.colour"),
    ],
)
def test_wrong_content_is_one_line(tmp_path, old, new, named) -> None:
    content = (data_folder() / "published" / "masoudi2015.toml").read_text(encoding="utf-8")
    assert old in content
    path = tmp_path / "published.toml"
    path.write_text(content.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(FileError) as caught:
        load_published(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    assert named in message

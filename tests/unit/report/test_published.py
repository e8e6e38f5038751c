"""Printed numbers and claims: present, as printed, and guarded by one clear line."""

from pathlib import Path

import pytest

from vehiclemor.errors import FileError
from vehiclemor.report.published import Published, load_published

GV = "independent_suspension_vehicle"
DW = "double_wishbone"
HFV = "high_fidelity_vehicle"
ANGLE = "second_euler_angle"
WRONG_PAGES = ["031007-9", "031007-0", "4", "x031007-4", "031007-44", "031007-4\\n"]

# id -> model, kind, value, unit, quantity, page, figure: typed from the paper, not from the file.
NUMBERS = {
    "gv_rms_pitch": (GV, "rms_error", 5.18e-4, "rad", "pitch", "031007-3", 4),
    "gv_rms_yaw": (GV, "rms_error", 7.59e-5, "rad", "yaw", "031007-3", 4),
    "gv_time_reduction": (GV, "time_reduction", 0.20, "1", "", "031007-4", None),
    "dw_rms_spindle_y": (DW, "rms_error", 7.57e-5, "m", "spindle_y", "031007-4", 7),
    "dw_rms_second_euler_angle": (DW, "rms_error", 2.4e-5, "rad", ANGLE, "031007-4", 7),
    "dw_time_reduction_3": (DW, "time_reduction", 0.65, "1", "", "031007-4", None),
    "dw_time_reduction_6": (DW, "time_reduction", 0.50, "1", "", "031007-7", 14),
    "hfv_rms_lateral_speed": (HFV, "rms_error", 0.0198, "m/s", "lateral_speed", "031007-5", 10),
    "hfv_rms_vertical_speed": (HFV, "rms_error", 0.0143, "m/s", "vertical_speed", "031007-5", 10),
    "hfv_time_reduction": (HFV, "time_reduction", 0.23, "1", "", "031007-5", None),
}

# id -> states, control period, snapshots behind the number, as far as the paper prints them.
BEHIND = {
    "gv_rms_pitch": (3, 0.5, None),
    "gv_rms_yaw": (3, 0.5, None),
    "gv_time_reduction": (3, 0.5, None),
    "dw_rms_spindle_y": (3, 5.0, 10),
    "dw_rms_second_euler_angle": (3, 5.0, 10),
    "dw_time_reduction_3": (3, 5.0, 10),
    "dw_time_reduction_6": (6, None, None),
    "hfv_rms_lateral_speed": (1, 0.1, 5),
    "hfv_rms_vertical_speed": (1, 0.1, 5),
    "hfv_time_reduction": (1, 0.1, 5),
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

# id -> page, figure: the claims that the comparison refers to.
CLAIMS = {
    "dw_fig6_nearly_identical": ("031007-4", 6),
    "dw_fig11_displacement_unaffected": ("031007-5", 11),
    "dw_fig11_angle_diverges_at_end": ("031007-5", 11),
    "dw_fig11_shorter_period_reduces_deviation": ("031007-5", 11),
    "dw_fig12_no_divergence": ("031007-6", 12),
    "dw_fig13_not_monotone_frequency": ("031007-6", 13),
    "dw_fig13_not_monotone_amplitude": ("031007-6", 13),
    "dw_fig13_angle_more_sensitive": ("031007-6", 13),
    "dw_fig14_three_states_fail": ("031007-7", 14),
    "dw_fig14_six_states_follow": ("031007-7", 14),
    "dw_more_robust_to_amplitude": ("031007-7", None),
}

PAPER = """
[paper]
authors = ["A. Author"]
title = "Title"
journal = "Journal"
volume = 10
number = 3
article = "031007"
year = 2015
doi = "10.1115/1.4029390"
note = "Note."
"""

NUMBER = """
[[number]]
id = "dw_rms"
model = "double_wishbone"
kind = "rms_error"
item = "RMS error"
quantity = "spindle_y"
value = 7.57e-5
unit = "m"
page = "031007-4"
section = "3.2"
figure = 7
"""

CLAIM = """
[[claim]]
id = "dw_claim"
model = "double_wishbone"
kind = "result"
statement = "a statement"
page = "031007-4"
section = "3.2"
"""


@pytest.fixture(scope="module")
def published() -> Published:
    return load_published()


def test_paper(published: Published) -> None:
    paper = published.paper
    assert paper.authors == ["Ramin Masoudi", "Thomas Uchida", "John McPhee"]
    assert (paper.volume, paper.number, paper.article, paper.year) == (10, 3, "031007", 2015)
    assert paper.doi == "10.1115/1.4029390"
    assert "never published its parameter set" in paper.note


@pytest.mark.parametrize("name", NUMBERS)
def test_number_is_as_printed(published: Published, name: str) -> None:
    number = published.numbers[name]
    found = (number.model, number.kind, number.value, number.unit, number.quantity)
    assert (*found, number.page, number.figure) == NUMBERS[name]
    assert (number.states, number.control_period, number.snapshots) == BEHIND[name]


@pytest.mark.parametrize("name", SETTINGS)
def test_setting_is_as_printed(published: Published, name: str) -> None:
    number = published.numbers[name]
    assert number.kind in ("setting", "perturbation")
    assert (number.value, number.unit, number.page) == SETTINGS[name]


def test_no_number_is_untested(published: Published) -> None:
    assert set(published.numbers) == set(NUMBERS) | set(SETTINGS)


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_of_the_comparison(published: Published, name: str) -> None:
    claim = published.claims[name]
    assert claim.model == DW
    assert (claim.page, claim.figure) == CLAIMS[name]


def test_ids_say_the_model(published: Published) -> None:
    prefix = {GV: "gv_", DW: "dw_", HFV: "hfv_", None: "all_"}
    for entry in (*published.numbers.values(), *published.claims.values()):
        assert entry.id.startswith(prefix[entry.model])


def test_small_file_loads(tmp_path: Path) -> None:
    found = load_published(_file(tmp_path, PAPER + NUMBER + CLAIM))
    assert list(found.numbers) == ["dw_rms"]
    assert list(found.claims) == ["dw_claim"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (NUMBER, NUMBER + NUMBER, "id 'dw_rms' occurs twice"),
        (CLAIM, CLAIM + CLAIM, "id 'dw_claim' occurs twice"),
        ("7.57e-5", "-7.57e-5", "dw_rms: an rms_error is positive"),
        ("7.57e-5", "0.0", "dw_rms: an rms_error is positive"),
        ('quantity = "spindle_y"\n', "", "names its quantity"),
        ("7.57e-5", "nan", "number.0.value"),
        ("7.57e-5", "inf", "number.0.value"),
        ("7.57e-5", '"7.57e-5"', "number.0.value"),
        ('"rms_error"', '"time_reduction"', "dw_rms: a time_reduction is between 0 and 1"),
        ('"rms_error"', '"guess"', "number.0.kind"),
        ("figure = 7", "figure = 15", "number.0.figure"),
        ("figure = 7", "states = 0", "number.0.states"),
        ("figure = 7", "control_period = 0.0", "number.0.control_period"),
        ("figure = 7", "colour = 1", "number.0.colour"),
        ('id = "dw_rms"', 'id = "dw rms"', "number.0.id"),
        ('"a statement"', '"two\\nlines"', "claim.0.statement"),
        ('"a statement"', '""', "claim.0.statement"),
        ('kind = "result"', 'kind = "rumour"', "claim.0.kind"),
        ("[paper]", "[papers]", "paper"),
        ("[paper]", "[paper", "not a valid TOML file"),
    ],
)
def test_wrong_content_is_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    content = PAPER + NUMBER + CLAIM
    assert content.count(old) == 1
    assert expected in _error(tmp_path, content.replace(old, new))


@pytest.mark.parametrize("value", ["0.0", "1.0", "65.0", "-0.2"])
def test_time_reduction_is_a_fraction(tmp_path: Path, value: str) -> None:
    number = NUMBER.replace("rms_error", "time_reduction").replace('"m"', '"1"')
    load_published(_file(tmp_path, PAPER + number.replace("7.57e-5", "0.65") + CLAIM))
    content = PAPER + number.replace("7.57e-5", value) + CLAIM
    assert "dw_rms: a time_reduction is between 0 and 1" in _error(tmp_path, content)


@pytest.mark.parametrize("page", WRONG_PAGES)
@pytest.mark.parametrize("entry", ["number", "claim"])
def test_wrong_page(tmp_path: Path, entry: str, page: str) -> None:
    changed = {"number": NUMBER, "claim": CLAIM}
    changed[entry] = changed[entry].replace("031007-4", page)
    assert f"{entry}.0.page" in _error(tmp_path, PAPER + changed["number"] + changed["claim"])


@pytest.mark.parametrize("entry", ["number", "claim"])
def test_foreign_model(tmp_path: Path, entry: str) -> None:
    changed = {"number": NUMBER, "claim": CLAIM}
    changed[entry] = changed[entry].replace("double_wishbone", "bicycle")
    message = _error(tmp_path, PAPER + changed["number"] + changed["claim"])
    assert f"{entry}.0.model" in message
    assert all(model in message for model in (GV, DW, HFV))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        load_published(tmp_path / "none.toml")


def _file(folder: Path, content: str) -> Path:
    path = folder / "published.toml"
    path.write_text(content, encoding="utf-8")
    return path


def _error(folder: Path, content: str) -> str:
    path = _file(folder, content)
    with pytest.raises(FileError) as caught:
        load_published(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message

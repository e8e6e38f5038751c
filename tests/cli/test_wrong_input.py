"""Wrong arguments and files: one clear line, exit status 2, and nothing is lost."""

import json
from pathlib import Path

import pytest

from vehiclemor.parameters import parameter_path

TRAVEL = "simulate double_wishbone"
POD = f"{TRAVEL} --method pod --set"
CAR = "simulate independent_suspension_vehicle"
FULL = "simulate high_fidelity_vehicle"
# What the line must say of a command.
WRONG = [
    ("simulate double_wishbon", "did you mean double_wishbone"),
    (f"{TRAVEL} --method pood", "did you mean pod"),
    (f"{TRAVEL} --maneuver sine", "unknown maneuver 'sine'"),
    (f"{CAR} --maneuver sine_travel", "gives inputs z, s0"),
    (f"{FULL} --maneuver lane_change", "needs s, s_dot, s_ddot"),
    (f"{TRAVEL} --start dropped", "unknown start 'dropped'"),
    (f"{TRAVEL} --training matchd", "did you mean matched"),
    (f"{TRAVEL} --method pod --preset litteral", "did you mean literal"),
    (f"{TRAVEL} --set solver=lu", "solver"),
    (f"{POD} rnak=3", "did you mean rank"),
    (f"{POD} rank", "key=value"),
    (f"{POD} rank=3 --set rank=4", "rank is given twice"),
    (f"{POD} rank=0", "rank is 0"),
    (f"{POD} rank=2.5", "rank"),
    (f"{POD} rank=9 --set snapshots=20", "rank 9"),
    (f"{POD} rank=6 --set snapshots=5", "snapshots 5"),
    (f"{POD} snapshots=1", "snapshots is 1"),
    (f"{POD} snapshots=1000000000", "snapshots"),
    (f"{POD} test_space=petrov", "test_space"),
    (f"{POD} control_period=0", "control_period"),
    (f"{POD} control_period=1e-9", "control_period"),
    (f"{POD} control_period=nan", "control_period"),
    (f"{POD} reversed_coordinates=theta", "theta"),
    (f"{TRAVEL} --frequency 0", "frequency factor: 0"),
    (f"{TRAVEL} --amplitude big", "big"),
    (f"{TRAVEL} --amplitude 3", "out of reach"),
    (f"{TRAVEL} --amplitude -2.2", "out of reach"),
    (f"{TRAVEL} --colour red", "--colour"),
    (f"{TRAVEL} --out run.txt", "run.txt"),
    (f"{TRAVEL} --out none/run.nc", "does not exist"),
    ("simulate", "model"),
    ("simulat double_wishbone", "simulat"),
    ("list cars", "cars"),
    ("run figure-15", "did you mean figure-1"),
    ("run no-such.toml", "no-such.toml"),
    ("run figures-6-7 --jobs 0", "jobs is 0"),
    ("compare papper", "did you mean paper"),
    ("figures --only 6,55", "'55'"),
    ("figures --only ,", "names no figure"),
    ("show pood", "did you mean pod"),
    ("show study-shema", "did you mean study-schema"),
    ("show double_wishbone --parameter wheel_centr=1", "did you mean wheel_centre"),
    ("show double_wishbone --parameter wheel_centre", "key=value"),
]
# A parameter of a model, and what the line must say beside it.
PARAMETERS = {
    TRAVEL: [
        ("wheel_centre=1", "3 components"),
        ("upper_arm_front_pivot=-100,470,105", "millimetres"),
        ("upper_arm_front_pivot=-0.25,0.51,0.11", "can't be assembled"),
    ],
    CAR: [
        ("sprung_mass=-900", "-900 kg"),
        ("unsprung_mass=0", "0 kg"),
        ("initial_speed=0", "0 m/s"),
        ("tire_stiffness=nan", "not finite"),
        ("front_damping=-1", "-1 N s/m"),
        ("front_track=1386.84", "1386.84 m"),
        # The sprung mass hangs over an axle: the wheels at the other end had to hold it down.
        ("front_axle_distance=0.05", "rear wheels leave the ground"),
        ("rear_axle_distance=0.05", "front wheels leave the ground"),
        ("tire_stiffness=5000", "can't stand"),
        ("whole_car_yaw_inertia=100", "yaw inertia"),
    ],
    FULL: [
        ("cup_holders=4", "not a parameter"),
        ("chassis_mass=-1515", "-1515 kg"),
        ("chassis_mass=1,2,3", "a number is needed"),
        ("gravity=0", "0 m/s^2"),
        ("gravity=1e3", "1000 m/s^2"),
        ("baumgarte_a=-50", "-50 1/s"),
        ("baumgarte_b=2e4", "20000 1/s"),
        ("initial_speed=0.5", "0.5 m/s"),
        ("tire_stiffness=nan", "not finite"),
        ("largest_friction=11", "11"),
        ("drop_height=5", "5 m"),
        ("rear_stiffness=0", "0 N/m"),
        ("wheel_centre=0.3", "3 components"),
        ("carrier_inertia=1,0,1", "0 kg m^2"),
        ("tie_rod_outer=-150,770,-120", "millimetres"),
        ("chassis_centre=1.7,0,0.2", "lifts the rear wheels"),
        ("chassis_centre=-1.7,0,0.2", "lifts the front wheels"),
        ("chassis_centre=0,0.3,0.2", "beside the midplane"),
        ("tire_stiffness=9000", "presses the front tires flat"),
        ("rear_wheel_centre=2,0.8,0", "not ahead of the rear"),
        ("upper_arm_front_pivot=-0.25,0.51,0.11", "upper arm axis"),
        ("front_spring_chassis_point=0,0.62,-0.27", "front spring has length 0"),
    ],
}
CARS = [
    (f"{car} --parameter {given}", word) for car in PARAMETERS for given, word in PARAMETERS[car]
]


@pytest.mark.parametrize(("command", "word"), WRONG + CARS)
def test_wrong_arguments(fails, command, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fails(command.split(), word)
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_wrong_are_named(fails, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(parameter_path("double_wishbone").read_text().replace('"m"', '"mm"'))
    fails([*TRAVEL.split(), "--parameter-file", path], str(path), "'mm'")
    path.write_bytes(bytes(range(256)))
    fails(["run", path], str(path), "UTF-8")


def test_output_that_is_something_else_is_kept(fails, tmp_path):
    out = tmp_path / "result.nc"
    out.write_text("my notes")
    simulate = [*TRAVEL.split(), "--out"]
    fails([*simulate, out], "result.nc", "move it away")
    fails([*simulate, tmp_path], "folder")
    fails(["run", "figures-6-7", "--results", out], "not a folder")
    fails(["figures", "--only", "5", "--out", out], "not a folder")
    assert out.read_text() == "my notes"


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a place where nobody writes")
def test_an_unwritable_output_folder(fails):
    fails(["run", "figures-6-7", "--results", "/proc/self/results"], "can't be written")
    fails(["figures", "--only", "5", "--out", "/proc/self/figures"], "can't be written")


def test_names_that_are_too_long(fails, tmp_path):
    long = tmp_path / ("n" * 300)
    fails([*TRAVEL.split(), "--out", f"{long}.nc"], "too long")
    fails(["run", "figures-6-7", "--results", long], "too long")
    fails(["run", f"{long}.toml"], "too long")


STUDY = """
title = "for the tests"
model = "double_wishbone"
[grid]
rank = [3]
[[methods]]
method = "pod"
"""
PROTOCOL = """
title = "for the tests"
model = "double_wishbone"
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", points = [[1.3, 1.0]] }]
test = [{ maneuver = "sine_travel", points = [[0.9, 1.0]] }]
bounds = { spindle_y = { measure = "rms", bound = 1e-4 } }
methods = [{ label = "newton", method = "full_order", role = "full order" }]
"""
# Part of the file -> what stands in its place, and what the line must say.
STUDIES = {
    "rank = [3]": [
        ("rank = []", "rank"),
        ("rank = 3", "grid.rank"),
        ("rank = [3, 3]", "same value twice"),
        ("rank = [12]", "rank 12"),
        ("rang = [3]", "unknown grid dimension"),
        ("amplitude_factor = [inf]", "amplitude"),
        ("frequency_factor = [-1.0]", "frequency"),
        ("rank = {first = 1.0, last = 2.0, count = 1000000000}", "count"),
        ("rank = {first = 1.0, last = 2.0, count = 0}", "count"),
        ("rank = {first = 1.0, last = inf, count = 3}", "grid.rank.span.last"),
        ("rank = {first = 1.0, count = 3}", "grid.rank.span.last"),
    ],
    'method = "pod"': [
        ('methode = "pod"', "methods.0"),
        ('method = "dmd"', "unknown method"),
        ('method = "pod"\n[[methods]]\nmethod = "pod"', "used twice"),
        ('method = "pod"\nsettings = {rank = 2}', "rank is set twice"),
    ],
    'title = "for the tests"': [
        ("", "title"),
        ("x = " + 2000 * "[" + 2000 * "]", "nested too deeply"),
        ("x = " + 5000 * "9", "not a valid TOML file"),
    ],
    'model = "double_wishbone"': [
        ("model = 3", "model"),
        ('model = "double_wishbone"\nmaneuver = "lane_change"', "gives inputs delta"),
    ],
    "[grid]": [
        ('training = "set"\n[grid]', "training_set"),
        ("keep = 'all'\n[grid]", "keep"),
        ("[grid", "not a valid TOML file"),
    ],
    STUDY: [
        ('title = "mine"\nstudies = ["double_wishbon"]', "unknown study"),
        ('title = "mine"\nstudies = ["absent.toml"]', "absent.toml"),
        ('title = "x"\nmodel = "x"\nstudies = ["double_wishbone"]', "nothing else"),
    ],
}
PROTOCOLS = {
    "points = [[0.9, 1.0]]": [
        ("points = [[1.0, 1.2]]", "is in training too"),
        ("points = [[1.3, 1.0]]", "is in validation too"),
        ("points = []", "points is empty"),
        ("points = [[0.9]]", "a point is [frequency, amplitude]"),
        ("points = [[0.9, 1.0, 20.0]]", "has no initial_speed"),
        ("points = [[-0.9, 1.0]]", "test, group 1"),
        ('start = ["droped"]', "unknown start 'droped'"),
        ("points = [[1.0, 1.0]], speed = [1.0]", "points or lists"),
    ],
    'test = [{ maneuver = "sine_travel"': [
        ('test = [{ maneuver = "lane_change"', "delta"),
        ('test = [{ maneuver = "sine"', "unknown maneuver"),
    ],
    'role = "full order"': [
        ('role = "umpire"', "methods.0.role"),
        ("candidates = [{ rank = 3 }]", "unknown setting of full_order"),
        ('candidates = [{ preset = "best" }]', "unknown preset"),
        ("candidates = [{}, {}]", "the same candidate twice"),
        ("candidates = []", "methods.0.candidates"),
        ('training = ["lane_change"]', "training of"),
    ],
    "title =": [
        ('targets = [{ against = "me", ratio = 2.0 }]\ntitle =', "target is against"),
        ("rounds = 3\ntitle =", "rounds"),
        ('keep = "metrics"\ntitle =', "keep"),
    ],
    '"for the tests"': [('""', "title: ''")],
    'label = "newton"': [('label = "a\\nb"', r"label: 'a\nb'")],
    '"double_wishbone"': [('"double_wishbon"', "unknown model")],
    "spindle_y": [("spindl_y", "unknown output")],
    '"rms"': [('"mean"', "bounds.spindle_y.measure")],
    "bound = 1e-4": [("bound = 0.0", "bounds.spindle_y.bound")],
    '"full_order"': [('"full_ordr"', "unknown method")],
}


def rows(table):
    return [(old, *row) for old, found in table.items() for row in found]


@pytest.mark.parametrize(("old", "new", "word"), rows(STUDIES))
def test_a_study_that_cant_be(fails, tmp_path, old, new, word):
    assert old in STUDY
    path = tmp_path / "mine.toml"
    path.write_text(STUDY.replace(old, new))
    fails(["run", path, "--results", tmp_path / "results"], word)
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(("old", "new", "word"), rows(PROTOCOLS))
def test_a_protocol_that_cant_be(fails, tmp_path, old, new, word):
    assert old in PROTOCOL
    path, study = tmp_path / "wrong.toml", tmp_path / "study.toml"
    path.write_text(PROTOCOL.replace(old, new, 1))
    study.write_text(f'title = "mine"\nstudies = {json.dumps([str(path)])}\n')
    fails(["run", study, "--results", tmp_path / "out"], "wrong.toml", word)

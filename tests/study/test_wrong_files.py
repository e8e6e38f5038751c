"""Study files that can't be: one line that names what is wrong, and nothing is written."""

import pytest

import vehiclemor as vm
from tests.models import CAR, WISHBONE
from tests.refusing import refused
from tests.study.conftest import SMALL

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
BOUND = '{ outputs = ["spindle_y"], measure = "rms", bound = 1e-4 }'
# Part of the file -> what stands in its place, and what the line must say.
STUDIES = {
    "rank = [3]": [
        ("rank = 3", "grid.rank"),
        ("rank = [3, 3]", "same value twice"),
        ("rank = [12]", "rank 12"),
        ("rank = [true]", "grid.rank.values.0 is True, neither a number nor a text"),
        ("rang = [3]", "unknown grid dimension"),
        ("frequency_factor = [-1.0]", "frequency"),
    ],
    'method = "pod"': [
        ('method = "pod"\n[[methods]]\nmethod = "pod"', "used twice"),
        ('method = "pod"\nsettings = {rank = 2}', "rank is set twice"),
        ('method = "pod"\nrole = "baseline"', "methods.0.role"),
    ],
    'title = "for the tests"': [
        ("x = " + 2000 * "[" + 2000 * "]", "nested too deeply"),
        ("x . 'y'\t.\"z\"" + ".a" * 50_000 + " = 1", "a key has more than 8 parts"),
        ("#" * 1_000_001, "bytes, more than 1000000"),
        (f"title = '{'x' * 900_000}'", "a text of 900000 characters"),
    ],
    'model = "double_wishbone"': [
        ('model = "double_wishbone"\nmaneuver = "lane_change"', "gives inputs delta")
    ],
    STUDY: [
        ('title = "mine"\nstudies = ["absent.toml"]', "absent.toml"),
        ("keep = 'a'\nmodel = 'x'", "title is missing; methods is missing; keep is 'a'; allowed"),
        ('title = "x"\nmodel = "x"\nstudies = ["a"]', "model is not a key of a collection: it"),
    ],
}
PROTOCOLS = {
    "points = [[0.9, 1.0]]": [
        ("points = [[1.0, 1.2]]", "is in training too"),
        ("points = []", "points: List should have at least 1 item"),
        ("points = [[0.9]]", "points.0: List should have at least 2 items"),
        ("points = [[1.0, 1.0]], speed = [1.0]", "points or lists"),
    ],
    'test = [{ maneuver = "sine_travel"': [('test = [{ maneuver = "lane_change"', "delta")],
    'role = "full order"': [
        ("candidates = { tolerance = 1e-3 }", "has a list of values"),
        ('training = ["lane_change"]', "training of"),
    ],
    "title =": [
        (
            'keep = "metrics"\ntitle =',
            "keep is not a key of a study with bounds: it belongs to a grid",
        ),
        ("report = ['toe']\ntitle =", "did you mean reported"),
        ("sampling = 1\ntitle =", "sampling is not a key of a study with bounds: known: "),
    ],
    '"for the tests"': [('""', "title: ''")],
    'label = "newton"': [('label = "a\\nb"', r"label: 'a\nb'")],
    '"double_wishbone"': [('"double_wishbon"', "unknown model")],
    "bound = 1e-4": [("bound = 0.0", "bounds.spindle_y.bound")],
    'bounds = { spindle_y = { measure = "rms", bound = 1e-4 } }': [
        ('bounds = [{ measure = "rms", bound = 1e-4 }]', "has a list of outputs"),
        (f"bounds = [{', '.join(2 * [BOUND])}]", "spindle_y is in two tables"),
    ],
    '"full_order"': [('"full_ordr"', "unknown method")],
}
MASSES = '{ "parameters.sprung_mass" = [1e3, 1e5] }'
LARGE = """[grid]
frequency_factor = { first = 0.7, last = 1.3, count = 600 }
amplitude_factor = { first = 0.5, last = 0.9, count = 60 }
"""
# Model, and what a study of it says.
GRIDS = [
    (WISHBONE, 'grid = { "parameters.tie_rod_inner" = [0.1] }', "tie_rod_inner"),
    (WISHBONE, 'start = ["equilibrium", "equilibrium"]', "start"),
    (WISHBONE, LARGE, "GB"),
    (CAR, 'grid = { maneuver = ["lane_change", "step_steer"] }', "metrics"),
    (CAR, f"grid = {MASSES}", "sprung_mass = 100000"),
]
GRID = 'title = "for the tests"\nmodel = "{}"\n{}\n[[methods]]\nmethod = "full_order"\n'
DRAWN = "frequency = [0.7, 2.0], amplitude = [0.5, 1.1]"
TWICE = '[[outside]]\nmaneuver = "chirp_travel"\npoints = [[1.0, 0.0]]\n\n[drawn]'
# Part of the protocol with drawn sets -> what stands in its place; words of the line in order.
DRAWS = [
    (DRAWN, "members = [2, 1]", "members...in order"),
    (DRAWN, 'both_signs = "yes"', "both_signs is 'yes', neither true nor false"),
    (DRAWN, "parameters.wheel = [0.0, 1.0]", "drawn, box 1: ...wheel"),
    (DRAWN, "parameters.wheel = [0.0, 0.0004]", "3 decimals"),
    (DRAWN, "parameters.initial_speed = [1.0, 2.0]", "by speed = ["),
    (
        "[[0.9, 1.0]]",
        "[[0.9, 1.0]]\nparameters.wheel = []",
        "wheel: List should have at least 1 item",
    ),
    ('maneuver = "chirp_travel"', 'maneuver = "chrp_travel"', "test, group 2: ...chirp_travel"),
    ("{ rank = 4 }", "{ rank = 3 }", "fixed basis"),
    ("{ tolerance = 1e-6 }", '{ tolerance = 1e-12, solver = "newton_lanes" }', "newton 1e-12"),
    ('reported = ["toe"]', 'reported = ["to"]', "toe"),
]
FILES = [
    (text, old, *row)
    for text, table in ((STUDY, STUDIES), (PROTOCOL, PROTOCOLS))
    for old, found in table.items()
    for row in found
]
FILES += [(STUDY, STUDY, GRID.format(model, text), words) for model, text, words in GRIDS]
FILES += [(SMALL, *row) for row in DRAWS]
# Without amplitude a chirp is a sine: one run under two names.
TWO = SMALL.replace("[[0.9, 1.0]]", "[[0.9, 1.0], [1.0, 0.0]]")
FILES += [(TWO, "[drawn]", TWICE, "outside: the scenario (chirp_travel... test")]


@pytest.mark.parametrize(("text", "old", "new", "words"), FILES)
def test_a_study_that_cant_be(tmp_path, text, old, new, words):
    assert old in text
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(old, new, 1))
    line = refused(lambda: vm.run_study(path, results=tmp_path / "results"))
    _, *others = line.partition(words.split("...")[0])
    assert all(word in "".join(others) for word in words.split("..."))
    assert not (tmp_path / "results").exists()

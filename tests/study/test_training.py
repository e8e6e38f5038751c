"""What a model is trained on, asked for by the same words everywhere, and told in every result."""

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import WISHBONE
from tests.study.small import small_study
from vehiclemor.cli.app import main
from vehiclemor.registry import component
from vehiclemor.report.comparison import study_comparison
from vehiclemor.study.run import run_studies
from vehiclemor.study.scenario import Scenario

OWN = component("maneuver", "sine_travel")
OTHER = component("maneuver", "chirp_travel")


def sampled(maneuver, last=1001, scale=1.0, name="log"):
    """A signal through the first samples of a maneuver."""
    times = maneuver.times[:last]
    return vm.Signal.from_samples(times, scale * maneuver.at(times), output_step=0.01, name=name)


def replayed(**arguments):
    return vm.simulate(WISHBONE, "replay", **arguments)


@pytest.mark.parametrize("given", [sampled(OTHER), "chirp_travel"], ids=str)
def test_nominal_is_the_models_own_maneuver_whatever_is_tested(given):
    run = replayed(maneuver=given, training="nominal")
    np.testing.assert_array_equal(run["outputs"], vm.simulate(WISHBONE)["outputs"])
    assert run["rms_error"].max() > 1e-4
    assert not run["in_training"]
    matched = replayed(maneuver=given)
    assert matched["in_training"]
    assert matched["rms_error"].max() < 1e-12


@pytest.mark.parametrize(
    "given", ["chirp_travel", (OTHER,), [Scenario(OTHER, "equilibrium"), "sine_travel"]], ids=str
)
def test_training_is_asked_for_in_the_same_words_everywhere(given):
    reduced = vm.reduce(WISHBONE, "replay", training=given)
    assert reduced.training[0] == Scenario(OTHER, "equilibrium")
    tested = OTHER.perturbed(1.01)
    found = replayed(maneuver=tested, training=given)
    np.testing.assert_array_equal(found["outputs"], reduced.simulate(tested).outputs)
    np.testing.assert_array_equal(
        found["outputs"], vm.simulate(WISHBONE, maneuver=OTHER)["outputs"]
    )


SAME = {
    "by name": ("sine_travel", OWN, True),
    "a signal of another name": (sampled(OWN, name="a"), sampled(OWN, name="b"), True),
    "one of several": ([OTHER, OWN], sampled(OWN), True),
    "its beginning": (OWN, sampled(OWN, 501), True),
    "that of which it is the beginning": (sampled(OWN, 501), OWN, False),
    "other samples": (OWN, sampled(OWN, scale=1.0 + 1e-6), False),
    "another amplitude": (OWN, OWN.perturbed(1.0, 0.9), False),
}


@pytest.mark.parametrize("case", SAME)
def test_a_run_of_the_training_is_marked_by_its_content(case):
    training, tested, marked = SAME[case]
    assert bool(replayed(training=training, maneuver=tested)["in_training"]) is marked
    # What learns from no run has none in its training.
    assert not vm.simulate(WISHBONE, training=training, maneuver=tested)["in_training"]


STUDY = """
training = ["nominal"]
grid = { amplitude_factor = [0.9, 1.0], rank = [3] }

[[methods]]
method = "pod"
label = "other"
training = "travel_and_rack"
"""


def test_runs_of_the_training_are_marked_in_a_study_its_tables_and_pictures(tmp_path, capsys):
    file = small_study(tmp_path, STUDY, "full_order", "replay")
    (dataset,) = run_studies(str(file), tmp_path).values()
    trained = dataset["in_training"].squeeze(drop=True).sel(label="replay")
    assert trained.to_series().to_dict() == {0.9: False, 1.0: True}
    assert dataset["in_training"].sum() == 1
    rows = study_comparison(str(file), tmp_path).set_index("label")
    assert (rows.loc["replay", "trained"] == 1).all()
    assert (rows.loc["replay", "runs"] == 2).all()
    assert (rows.loc["other", "trained"] == 0).all()
    assert main(["run", str(file), "--results", str(tmp_path)]) == 0
    assert "; 1 trained on the tested run" in " ".join(capsys.readouterr().out.split())
    for factor, name in ((1.0, "replay*"), (0.9, "replay")):
        (legend,) = vm.plot(dataset, amplitude_factor=factor).legends
        assert {name, "other"} <= {text.get_text() for text in legend.get_texts()}

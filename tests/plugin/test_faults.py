"""Components by their entry points: unknown names, and plug-ins that break and harm nothing."""

import re
from contextlib import ExitStack

import numpy as np
import pytest

import vehiclemor as vm
from tests.plugin.installation import installed, package, registered
from vehiclemor.cli import main
from vehiclemor.exceptions import InputError, VehiclemorError
from vehiclemor.reduction.methods import pod, replay
from vehiclemor.registry import component, names, unknown


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        ("model", "double_wishbon", "double_wishbone?"),
        ("method", "full-order", "full_order?"),
        ("method", "PID", "known: balanced_truncation, "),
        ("maneuver", "sine", "sine_travel"),
        ("model", "", "known: "),
    ],
)
def test_unknown_name_lists_the_nearest(kind, name, words):
    with pytest.raises(InputError, match=f"unknown {kind} '{name}'; .*{re.escape(words)}"):
        component(kind, name)


def test_nearest_names_come_best_first_and_many_are_not_listed():
    few = str(unknown("colour", "gren", ["violet", "green", "grey", "blue"]))
    assert few.endswith("green or grey?")
    many = str(unknown("colour", "0", [f"shade_{number}" for number in range(200)]))
    assert "; 200 are known: " in many
    assert len(many) < 120


def test_plug_ins_register_as_built_ins_do_and_take_no_name_of_theirs(tmp_path):
    (tmp_path / "mine.py").write_text("from vehiclemor.reduction.methods.replay import METHOD")
    built_in = names("method")
    with installed(package(tmp_path, mine="mine:METHOD", pod="thief:METHOD")):
        with pytest.warns(UserWarning, match="method 'pod': thief:METHOD is left out"):
            assert names("method") == sorted([*built_in, "mine"])
        assert component("method", "mine") is replay.METHOD
        assert component("method", "pod") is pod.METHOD
    assert names("method") == built_in


@pytest.fixture
def plug_in(tmp_path, monkeypatch):
    """Register a module text as a method or else, beside the built-ins."""

    with ExitStack() as stack:

        def register(name, text, attribute="", kind="method"):
            # Another name in each test: what was imported before stays imported.
            module = f"{name}_{tmp_path.name}"
            (tmp_path / f"{module}.py").write_text(text)
            monkeypatch.syspath_prepend(tmp_path)
            stack.enter_context(registered(kind, name, f"{module}{attribute}"))

        yield register


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def fit(:", "SyntaxError"),
        ("summary = 'half'", "is of type module"),
        ("raise SystemExit(3)", "SystemExit: 3"),
        ("raise ValueError('one\\ntwo')", "ValueError: one two"),
    ],
)
def test_a_broken_plug_in_is_named_and_harmless(plug_in, text, words):
    plug_in("faulty", text)
    listed = vm.methods()
    assert words in listed["faulty"]
    assert listed["pod"].startswith("POD")
    with pytest.raises(VehiclemorError, match="faulty"):
        component("method", "faulty")
    plug_in("faulty", "", ":no_such_object", "maneuver")
    with pytest.raises(VehiclemorError, match=r"'faulty' .*no_such_object"):
        component("maneuver", "faulty")


REPLAY = """
from dataclasses import replace
import signal, time
import numpy as np
from vehiclemor.reduction.interface import OfflineCost
from vehiclemor.reduction.methods import replay
class Reduced:
    offline, order = OfflineCost(), 0
    def __init__(self, inner): self.inner = inner
    def simulate(self, *given): return self.inner.simulate(*given)
    def best_approximation(self, states): return None
def fit(*given): return Reduced(replay.METHOD.fit(*given))
def altered(**values):
    def simulate(self, *given):
        run = self.inner.simulate(*given)
        return replace(run, **{name: change(getattr(run, name)) for name, change in values.items()})
    Reduced.simulate = simulate
METHOD = replace(replay.METHOD, name="faulty", fit=fit)
def ends(error):
    def ended(*_):
        raise error
    return ended
def zeroed(model, *_):
    model.constants[:] = 0
class Speechless(Exception):
    def __str__(self): raise ValueError("no text")
def interrupted(*_):
    signal.raise_signal(signal.SIGINT)
    time.sleep(1)
"""
STUDY = """
title = "mine"
model = "double_wishbone"
[[methods]]
method = "faulty"
[[methods]]
method = "replay"
"""
REFUSALS = ("1 / 0", "3", "None")


@pytest.fixture
def faulty(plug_in):
    """A method whose text ends in a change."""
    return lambda change: plug_in("faulty", f"{REPLAY}{change}\n", ":METHOD")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("METHOD = replace(METHOD, fit=lambda *_: 1 / 0)", "fit: ZeroDivisionError"),
        ("METHOD = replace(METHOD, fit=zeroed)", "fit: ValueError"),
        ("METHOD = replace(METHOD, fit=ends(Speechless()))", "fit: Speechless (/"),
        ("METHOD = replace(METHOD, fit=ends(ValueError('\\x1b[31m')))", r"ValueError: \x1b[31m (/"),
        ("Reduced.simulate = lambda *_: None", "simulate gives None"),
        ("Reduced.best_approximation = lambda _, s: s[:3]", "(3, 8)"),
        ("Reduced.offline = None", "offline is None"),
        ("altered(outputs=lambda o: o + 0j)", "outputs (1001, 6) of complex128"),
        ("altered(status=lambda s: 'fine')", "status 'fine'"),
        ("altered(counts=lambda c: None)", "counts None"),
    ],
)
def test_a_method_that_breaks_is_an_error_of_its_own_runs(faulty, change, words):
    faulty(change)
    data = vm.simulate("double_wishbone", "faulty")
    message = data["message"].item()
    assert data["status"].item() == "error"
    assert words in message
    assert message.isprintable()
    assert np.isnan(data["rms_error"]).all()


@pytest.mark.parametrize(
    ("change", "status"),
    [("altered(outputs=lambda o: o[1:])", "error")]
    + [(f"METHOD = replace(METHOD, refusal=lambda m: {text})", "rejected") for text in REFUSALS],
)
def test_a_study_with_a_broken_method_is_finished(faulty, tmp_path, change, status):
    faulty(change)
    path = tmp_path / "mine.toml"
    path.write_text(STUDY)
    data = vm.run_study(path, results=tmp_path / "results").squeeze()
    assert data["status"].values.tolist() == [status, "ok"]
    if status == "rejected":
        assert "refusal" in data["message"].values[0]
        with pytest.raises(InputError, match="method 'faulty': refusal"):
            vm.simulate("double_wishbone", "faulty")


@pytest.mark.parametrize(
    ("fit", "status", "words"),
    [
        ("ends(OSError(28, 'no space'))", 1, "method 'faulty': fit: no space (/"),
        ("interrupted", 130, "stopped"),
    ],
)
def test_the_machine_or_the_user_stops_a_method(faulty, capsys, fit, status, words):
    faulty(f"METHOD = replace(METHOD, fit={fit})")
    assert main(["simulate", "double_wishbone", "--method", "faulty"]) == status
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("settings=None", "settings: AttributeError"),
        ("settings={'ae': dict}", "settings of ae"),
        ("presets={'ae': {'mine': {'rnk': 3}}}", "preset 'mine' of ae 'rnk'"),
        ("summary='\\x1b[2Jgone'", r"summary is '\x1b[2Jgone'"),
        ("fit=3", "fit is not a function"),
        ("learns_from='run'", "unknown learns_from of 'faulty' 'run'"),
    ],
)
def test_a_declaration_that_is_none_is_listed_with_what_is_wrong(faulty, change, words):
    faulty(f"METHOD = replace(METHOD, {change})")
    assert words in vm.methods()["faulty"]
    with pytest.raises(InputError, match="faulty"):
        vm.simulate("double_wishbone", "faulty")


CAR = """
from dataclasses import replace
import numpy as np
import sympy as sp
from vehiclemor.symbolic.program import assemble
from vehiclemor.symbolic.tape import Tape
from quarter_car.model import DEFINITION as CAR, PARAMETERS
def derived(derivative, outputs):
    x = sp.symbols("z_s z_u v_s v_u", real=True)
    u, p = sp.symbols("road", real=True), sp.symbols([f"p_{n}" for n in PARAMETERS])
    functions = {"derivative": (derivative(x), (4,)), "outputs": (outputs, (len(outputs),))}
    return lambda: assemble(Tape(), {"x": x, "u": [u]}, p, functions)
def faulty(**changes):
    return replace(CAR, name="faulty", **changes)
"""


@pytest.fixture
def car(plug_in, plug_in_package, tmp_path):
    """The quarter car with a change, as the model `faulty` of its own parameter file."""
    path, source = tmp_path / "faulty.toml", component("model", "quarter_car").parameter_file
    path.write_text(source.read_text().replace('"quarter_car"', '"faulty"'))

    def build(change):
        plug_in("faulty", f"{CAR}\nDEFINITION = {change}\n", ":DEFINITION", "model")
        return vm.model("faulty", parameter_file=path)

    return build


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("faulty(derive=lambda: 1 / 0)", "equations can't be derived: ZeroDivisionError"),
        ("faulty(derive=derived(lambda x: x[:3], [0, 0, 0]))", "derivative has 3 results"),
        ("faulty(derive=derived(lambda x: x, [0]))", "outputs has shape"),
        ("faulty(starts=lambda p: {'a': [0.0]})", "start 'a' has shape"),
        ("faulty(solved=('a',))", "solve_equilibrium: KeyError: 'a'"),
        ("faulty(summary=None)", "summary of a model is None"),
        ("faulty(coordinates=('a', 'b'))", "coordinates must be quantities"),
        ("faulty(parameters={'a': 3})", "parameter 'a'"),
    ],
)
def test_a_model_that_breaks_is_named(car, change, words):
    with pytest.raises(InputError, match=words):
        car(change)
    assert "faulty" in vm.models()


def test_plain_numbers_among_the_results_of_a_model(car):
    model = car("faulty(derive=derived(lambda x: [x[2], x[3], 0, -1.5], [0, 1, 2.5]))")
    np.testing.assert_array_equal(model.rhs([0, 0, 1, 2], 0.0), [1, 2, 0, -1.5])
    outputs = model.outputs_at(np.zeros((2, 4)), np.zeros((2, 1)))
    np.testing.assert_array_equal(outputs, [[0, 1, 2.5]] * 2)

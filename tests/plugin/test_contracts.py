"""The contracts that authors of plug-ins call: they pass what works and name what is broken."""

from dataclasses import replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vehiclemor as vm
from tests.models import TRUCK
from tests.plugin.installation import installed, package
from vehiclemor import contracts
from vehiclemor.exceptions import InputError
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.registry import component, names
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.study.experiment import complete_settings

EXAMPLE = Path(__file__).parents[2] / "examples" / "my_method.py"
KINEMATIC = [name for name in names("model") if component("model", name).kind == "ae"]


@pytest.mark.usefixtures("plug_in_package")
@pytest.mark.parametrize("name", names("method"))
def test_registered_methods_pass_on_a_plug_ins_model(name):
    contracts.check_method(name, "quarter_car")


def test_a_method_of_structures_passes():
    contracts.check_method("craig_bampton", TRUCK)


@pytest.mark.parametrize(
    ("alter", "message"),
    [
        (lambda s: replace(s, stiffness=s.stiffness + s.ports @ s.ports[::-1].T), "not symmetric"),
        (lambda s: replace(s, outputs=tuple(c[1:] for c in s.outputs)), "outputs of q has shape"),
        (lambda s: replace(s, dampers=s.dampers[1:]), "dampers has shape"),
        (lambda s: replace(s, stiffness=s.stiffness * np.nan), "not finite"),
    ],
)
def test_a_broken_structure_is_named(monkeypatch, alter, message):
    model = vm.model(TRUCK)
    definition = replace(model.definition, structure=lambda v: alter(model.definition.structure(v)))
    monkeypatch.setattr(contracts, "build", lambda _: replace(model, definition=definition))
    with pytest.raises(InputError, match=message):
        contracts.check_model(TRUCK)


@pytest.mark.parametrize("off", [0.0, 1e-6])
def test_a_jacobian_is_judged_by_the_size_of_the_residual(monkeypatch, off):
    # Residuals in micrometres, and an element that is wrong by a millionth of the largest.
    for name in ("residual", "jacobian"):
        plain = getattr(AlgebraicModel, name)
        wrong = 1.0 + off * (name == "jacobian")
        scaled = lambda *given, plain=plain, wrong=wrong: 1e6 * wrong * plain(*given)  # noqa: E731
        monkeypatch.setattr(AlgebraicModel, name, scaled)
    if not off:
        contracts.check_model(KINEMATIC[0])
    else:
        with pytest.raises(AssertionError, match="Jacobian differs"):
            contracts.check_model(KINEMATIC[0])


@pytest.mark.usefixtures("plug_in_package")
@pytest.mark.parametrize("method", ["pod", "fixed_basis"])
def test_a_preset_lowers_its_rank_to_the_number_of_coordinates(method):
    car = vm.model("quarter_car")
    for preset in component("method", method).presets_of("ode"):
        assert complete_settings(car, method, {}, preset)["rank"] == len(car.coordinates) == 2
        # One that is given is never changed.
        with pytest.raises(InputError, match="rank 3 is above the 2 coordinates"):
            vm.simulate(car, method, preset=preset, rank=3, formulation="coordinates")
    assert complete_settings(vm.model("double_wishbone"), method, {})["rank"] == 3


def test_the_method_of_the_example_works_as_it_stands(tmp_path):
    method, *_ = EXAMPLE.read_text(encoding="utf-8").partition("# An entry point")
    (tmp_path / "example_method.py").write_text(method)
    with installed(package(tmp_path, polynomials="example_method:METHOD")):
        contracts.check_method("polynomials", "double_wishbone")
        arguments = {"frequency": 1.4, "training": "nominal"}
        data = vm.simulate("double_wishbone", "polynomials", **arguments)
    # The mechanism's path is a curve: wheel travel alone determines all coordinates.
    assert float(data["rms_error"].sel(output="second_euler_angle")) < 1e-4


@pytest.fixture
def instead(monkeypatch):
    """Let the contracts find this component in the place of any other of its kind."""

    def found(kind, this):
        monkeypatch.setattr(
            contracts, "component", lambda k, n: this if k == kind else component(k, n)
        )

    return found


def altered(alter):
    """The method `replay` whose trajectories are altered, each in another way."""
    method, runs = component("method", "replay"), count(1)

    def fit(*arguments):
        reduced = method.fit(*arguments)

        def simulate(*arguments):
            return alter(reduced.simulate(*arguments), next(runs))

        best = reduced.best_approximation
        return SimpleNamespace(
            simulate=simulate, best_approximation=best, order=0, offline=reduced.offline
        )

    return replace(method, fit=fit)


@pytest.mark.parametrize(
    ("alter", "message"),
    [
        (lambda run, _: replace(run, coordinates=run.coordinates[1:]), r"coordinates \(\d+, 8\)"),
        (lambda run, k: replace(run, coordinates=run.coordinates + 1e-15 * k), "two runs differ"),
        (lambda run, k: replace(run, counts=run.counts | {"iterations": k}), "counts of two runs"),
        (lambda run, _: replace(run, counts={}), "counts are incomplete"),
        (lambda run, _: replace(run, coordinates=run.coordinates * np.nan), "not finite"),
        (lambda run, _: replace(run, status="fine"), "status 'fine'"),
    ],
)
def test_broken_method_is_named(instead, alter, message):
    instead("method", altered(alter))
    with pytest.raises(AssertionError, match=message):
        contracts.check_method("replay", KINEMATIC[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": (Quantity("s0", "m", "one"), Quantity("z", "m", "two"))}, "other inputs"),
        ({"coordinates": (Quantity("one", "m", "one"),), "stops": {}}, "residual has shape"),
        ({"maneuver": "lane_change"}, "its maneuver gives other inputs"),
    ],
)
def test_broken_declaration_is_named(instead, change, message):
    instead("model", replace(component("model", KINEMATIC[0]), **change))
    with pytest.raises(AssertionError, match=message):
        contracts.check_model(KINEMATIC[0])

"""The contracts that authors of plug-ins call: they pass what works and name what is broken."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vehiclemor import contracts
from vehiclemor.multibody.quantities import Quantity
from vehiclemor.multibody.report import ModelReport, TimingCase
from vehiclemor.registry import component, names

KINEMATIC = [name for name in names("model") if component("model", name).kind == "ae"]


@pytest.mark.parametrize("model", KINEMATIC)
@pytest.mark.parametrize("name", names("method"))
def test_registered_methods_pass(model: str, name: str) -> None:
    contracts.check_method(name, model)


@pytest.fixture
def instead(monkeypatch: pytest.MonkeyPatch):
    """Let the contracts find this component in the place of any other of its kind."""

    def found(kind: str, this: object) -> None:
        monkeypatch.setattr(
            contracts, "component", lambda k, n: this if k == kind else component(k, n)
        )

    return found


class Altered:
    """The method `replay` whose trajectories are altered, each in another way."""

    def __init__(self, alter) -> None:
        self._method, self._alter, self._runs = component("method", "replay"), alter, 0

    def __getattr__(self, name: str) -> object:
        return getattr(self._method, name)

    def fit(self, *arguments: object) -> SimpleNamespace:
        reduced = self._method.fit(*arguments)

        def simulate(*arguments: object):
            self._runs += 1
            return self._alter(reduced.simulate(*arguments), self._runs)

        return SimpleNamespace(simulate=simulate, effective_rank=0, offline=reduced.offline)


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
def test_broken_method_is_named(instead, alter, message: str) -> None:
    instead("method", Altered(alter))
    with pytest.raises(AssertionError, match=message):
        contracts.check_method("replay", KINEMATIC[0])


UNKNOWN = (
    TimingCase("baseline", "a", "full_order"),
    TimingCase("strongest", "b", "no_such_method"),
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": (Quantity("s0", "m", "one"), Quantity("z", "m", "two"))}, "other inputs"),
        ({"coordinates": (Quantity("one", "m", "one"),), "stops": {}}, "residual has shape"),
        ({"maneuver": "lane_change"}, "its maneuver gives other inputs"),
        ({"report": ModelReport(timing=UNKNOWN)}, "unknown methods"),
    ],
)
def test_broken_declaration_is_named(instead, change, message: str) -> None:
    instead("model", replace(component("model", KINEMATIC[0]), **change))
    with pytest.raises(AssertionError, match=message):
        contracts.check_model(KINEMATIC[0])

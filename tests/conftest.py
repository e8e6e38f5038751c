"""Fixtures and settings that all tests share."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import matplotlib
import numpy as np
import pytest

from tests.plugin.installation import installed
from vehiclemor.cli import main
from vehiclemor.exceptions import VehiclemorError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build
from vehiclemor.simulation.trajectory import Trajectory

matplotlib.use("Agg")

# Timing decides nothing, so no example has a deadline; in CI every run tries the same examples.
hypothesis.settings.register_profile("dev", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True)
IN_CI = os.environ.get("CI", "").lower() in ("1", "true", "yes")
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if IN_CI else "dev"))


# What takes long to derive and compile, and many files need, for two processes side by side.
COMPILATIONS = (
    """
import vehiclemor as vm
from vehiclemor.inputs.steering import straight_ahead
car = vm.model("independent_suspension_vehicle")
for solver in ("dopri5", "etdrk4"):
    car.simulate(straight_ahead, times=[0.1], solver=solver, tolerance=1e-2)
""",
    """
import vehiclemor as vm
vm.model("double_wishbone").solve([0.05, 0.0])
car = vm.model("high_fidelity_vehicle")
car.jacobian(car.start(), [0.0] * 3, "state")
""",
)


def pytest_configure(config: pytest.Config) -> None:
    """Before tests run in several processes, compile once what each would compile for itself."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        commands = [[sys.executable, "-c", text] for text in COMPILATIONS]
        # A failure shows in the tests, where it belongs.
        for process in [subprocess.Popen(command) for command in commands]:
            process.wait()


# Folders and files whose tests take long.
SLOW = (
    *(
        "contracts",
        "plugin",
        "reference",
        "report",
        "study",
        "unit/exporting",
        "unit/test_files.py",
    ),
    *("texts/test_pages.py", "texts/test_examples.py"),
    "unit/reduction/methods/test_slow_manifold.py",
    "unit/reduction/test_crafted_files.py",
    "unit/reduction/test_saved.py",
    "unit/reduction/test_second_order_methods.py",
    "unit/reduction/vehicle/test_lifting.py",
)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark slow tests, so that the quick ones can be run alone; with several processes, last."""
    folder = Path(__file__).parent
    for item in items:
        if item.path.relative_to(folder).as_posix().startswith(SLOW):
            item.add_marker("slow")
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Where tests run in several processes, keep those together that share long computations."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "report" if nodeid.startswith("tests/report/") else nodeid.partition("::")[0]

    # In the order above, not by the number of tests in a file: a long file must not be the last.
    config.option.loadscopereorder = False
    return ByFile(config, log)


@pytest.fixture(scope="session", autouse=True)
def _every_error_is_one_line() -> Iterator[None]:
    """Errors that the package raises in any test are one line, which no test checks itself."""
    plain = VehiclemorError.__init__

    def checked(self: VehiclemorError, *given: object) -> None:
        plain(self, *given)
        assert "\n" not in str(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(VehiclemorError, "__init__", checked)
        yield


@pytest.fixture(scope="session")
def model() -> AlgebraicModel:
    """Double wishbone with its own parameters."""
    return build("double_wishbone")


@pytest.fixture(scope="session")
def points(model: AlgebraicModel) -> dict[str, np.ndarray]:
    """Hard points by name."""
    return model.parameters.values()


@pytest.fixture(scope="session")
def nominal() -> Maneuver:
    """The paper's wheel travel."""
    return component("maneuver", "sine_travel")


@pytest.fixture(scope="session")
def full(model: AlgebraicModel, nominal: Maneuver) -> Trajectory:
    """Full-order solution of the paper's wheel travel."""
    return model.simulate(nominal)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20150301)


@pytest.fixture(scope="module")
def plug_in_package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """What `vehiclemor new-plugin quarter_car` writes, as if installed."""
    source = tmp_path_factory.mktemp("plugin") / "quarter_car_plugin"
    assert main(["new-plugin", "quarter_car", "--out", str(source)]) == 0
    with installed(source):
        yield source

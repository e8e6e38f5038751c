"""Fixtures of the unit tests: a plug-in model of standard problems."""

from importlib.metadata import EntryPoint

import pytest

from vehiclemor import registry
from vehiclemor.simulation.build import build as built


@pytest.fixture(scope="session")
def standard():
    """Builder of the standard problems: parameter values -> model."""
    entry = EntryPoint(
        "standard_problems", "tests.unit.standard_problems:DEFINITION", "vehiclemor.models"
    )
    known = {**registry._entries("model"), "standard_problems": entry}
    real = registry._entries

    def build(**values):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(
                registry, "_entries", lambda kind: known if kind == "model" else real(kind)
            )
            return built("standard_problems", overrides=values)

    return build

"""Fixtures of the unit tests: plug-in models with known solutions."""

from importlib.metadata import EntryPoint

import pytest

from vehiclemor import registry
from vehiclemor.simulation.build import build as built


def builder(name):
    """Builder of a model of the tests: parameter values -> model."""
    entry = EntryPoint(name, f"tests.unit.{name}:DEFINITION", "vehiclemor.models")
    known = {**registry._entries("model"), name: entry}
    real = registry._entries

    def build(**values):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(
                registry, "_entries", lambda kind: known if kind == "model" else real(kind)
            )
            return built(name, overrides=values)

    return build


@pytest.fixture(scope="session")
def standard():
    """Builder of the standard problems."""
    return builder("standard_problems")


@pytest.fixture(scope="session")
def chain():
    """Builder of the standing chain, a structure."""
    return builder("standing_chain")

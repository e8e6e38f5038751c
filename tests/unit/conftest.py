"""Fixtures of the unit tests: plug-in models with known solutions."""

import pytest

from tests.plugin.installation import registered
from vehiclemor.simulation.build import build as built


def builder(name):
    """Builder of a model of the tests: parameter values -> model."""

    def build(**values):
        with registered("model", name, f"tests.unit.{name}:DEFINITION"):
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

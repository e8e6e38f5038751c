"""Parts of saved models by declared types: what a file can't make, and what can't be written."""

from typing import Any

import pytest

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.parts import Parts
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.model import Model


@pytest.fixture(scope="module")
def model():
    return build("independent_suspension_vehicle")


@pytest.mark.parametrize("declared", [DynamicModel, Model, DynamicModel | None, Any])
@pytest.mark.parametrize("part", [{}, {"definition": {}, "system": {}, "equations": {}}])
def test_models_are_referred_to_and_never_built_from_a_file(model, part, declared):
    reader = Parts(model)
    assert reader.read({"@full": "model"}, "model", declared) is model
    with pytest.raises(ValueError, match="model"):
        reader.read(part, "model", declared)


def test_another_model_is_not_written(model):
    other = build("independent_suspension_vehicle", overrides={"sprung_mass": 1400.0})
    with pytest.raises(InputError, match="it can't be saved: model is"):
        Parts(model).write(other, "model", DynamicModel)

"""What is shown is what was declared, and fits into 80 columns, whatever is registered."""

import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.cli.app import COMMANDS
from vehiclemor.cli.options import key_values
from vehiclemor.codegen import cache, derivation
from vehiclemor.parameters import load_parameters
from vehiclemor.registry import component, names
from vehiclemor.report.description import SCHEMAS
from vehiclemor.resources import data_names, handbook_folder
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.toml_files import FileSchema


@pytest.mark.parametrize("name", names("model"))
def test_a_model_shows_all_that_it_declares(name):
    model, definition = vm.model(name), component("model", name)
    shown = vm.describe(name)
    for kind in ("inputs", "outputs", "coordinates", "speeds", "equations", "constraints"):
        declared = [(q.name, q.unit, q.long_name) for q in getattr(definition, kind)]
        assert [tuple(row.values()) for row in shown[kind]] == declared
    entries = load_parameters(name, definition.parameters, definition.parameter_file).entries
    for row, (parameter, entry) in zip(shown["parameters"], entries.items(), strict=True):
        assert (row["name"], row["value"], row["unit"]) == (parameter, entry.value, entry.unit)
        assert (row["status"], row["source"]) == (entry.status, entry.source)
    assert {row["source"] for row in shown["sources"]} >= {e.source for e in entries.values()}
    assert shown["starts"] == list(model.starts)
    accepting = [m for m in names("method") if component("method", m).accepts(model)[0]]
    assert shown["methods"] == accepting


@pytest.mark.parametrize("name", names("method"))
def test_a_method_shows_every_setting_of_every_kind(name):
    models = {model: vm.model(model) for model in names("model")}
    shown, method = vm.describe(name), component("method", name)
    for kind, declared in method.settings.items():
        (table,) = [rows for key, rows in shown.items() if {"settings,", kind} <= set(key.split())]
        assert [row["name"] for row in table] == list(declared.model_fields)
        for row, field in zip(table, declared.model_fields.values(), strict=True):
            assert row["meaning"] == field.description
            assert row["default"] == field.default
    presets = {(row["preset"], row["kind"]) for row in shown["presets"]}
    assert presets == {(p, kind) for kind in method.settings for p in method.presets_of(kind)}
    for row in shown["models"]:
        accepted, reason = method.accepts(models[row["model"]])
        assert (row["accepted"], row["reason"]) == ("yes" if accepted else "no", reason)


@pytest.mark.parametrize("name", names("maneuver"))
def test_a_maneuver_shows_its_inputs_and_the_models_it_drives(name):
    shown, maneuver = vm.describe(name), component("maneuver", name)
    assert [row["name"] for row in shown["inputs"]] == list(maneuver.inputs)
    signals = maneuver.at(maneuver.times)
    assert [row["largest"] for row in shown["inputs"]] == signals.max(axis=0).tolist()
    for model in shown["models"]:
        assert vm.model(model).inputs == maneuver.inputs


def test_a_study_shows_its_grid():
    for name in data_names("studies"):
        shown, definitions = vm.describe(name), load_studies(name)
        if name in definitions and definitions[name].grid:
            assert shown["grid points"] == definitions[name].points
            assert [row["dimension"] for row in shown["grid"]] == list(definitions[name].grid)
    members = {row["study"]: row["runs"] for row in vm.describe("paper")["studies"]}
    assert members["figure-13-frequency"] == 31 * 5
    assert vm.describe("paper")["runs"] == sum(members.values())
    protocol = load_protocol("predictive-independent_suspension_vehicle").definition
    runs = vm.describe("predictive-independent_suspension_vehicle")["runs"]
    assert f"{protocol.drawn.runs} drawn" in runs
    assert f"{sum(g.scenarios for g in protocol.validation)} validation" in runs


@pytest.mark.parametrize("name", SCHEMAS)
def test_the_schema_of_a_file_has_every_key(name):
    shown = vm.describe(name)
    assert [row["name"] for row in shown["keys"]] == list(SCHEMAS[name].model_fields)
    tables = {part.__name__: part for part in FileSchema.__subclasses__()}
    inner = SCHEMAS[name].model_json_schema().get("$defs", ())
    for title, part in [("keys", SCHEMAS[name]), *((key, tables[key]) for key in inner)]:
        for row, field in zip(shown[title], part.model_fields.values(), strict=True):
            assert row["meaning"] == (field.description or "")
            assert (row["default"] == "required") is field.is_required()


def test_a_model_that_was_not_derived_is_shown_without_deriving_it(monkeypatch, tmp_path):
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(derivation, "cache_folder", lambda: tmp_path)
    starts = {name: vm.describe(name)["starts"] for name in names("model")}
    assert starts["double_wishbone"] == ["equilibrium"]
    assert starts["independent_suspension_vehicle"] == ["equilibrium", "dropped"]
    assert starts["high_fidelity_vehicle"] == ["known once the model has been simulated"]
    assert "pod" in vm.describe("high_fidelity_vehicle")["methods"]
    assert {row["accepted"] for row in vm.describe("slow_manifold")["models"]} == {"no", "?"}
    assert list(tmp_path.iterdir()) == []


def test_bounds_and_overrides_are_shown():
    rows = {row["name"]: row for row in vm.describe("full_order")["settings, kind ode and dae"]}
    assert rows["solver"]["type"].startswith("dopri5, rodas4, ros34pw2")
    assert rows["tolerance"]["type"] == "number 1e-13 to 0.1"
    rows = vm.describe("double_wishbone", {"wheel_centre": [0.0, 0.8, -0.1]})["parameters"]
    (row,) = [row for row in rows if row["name"] == "wheel_centre"]
    assert (row["value"], row["source"]) == ([0.0, 0.8, -0.1], "override")


def test_text_of_the_command_line_gets_its_kind():
    texts = ["3", "-2", "2.5", "1e-6", "fast", "3a", "1,2.5", "theta,alpha"]
    values = [3, -2, 2.5, 1e-6, "fast", "3a", [1.0, 2.5], "theta,alpha"]
    found = [key_values("--set", [f"a={text}"])["a"] for text in [*texts, ""]]
    assert list(map(repr, found)) == list(map(repr, [*values, ""]))


def test_the_handbook_is_where_the_help_says(capsys):
    assert (handbook_folder() / "add-a-model-or-method.md").is_file()
    assert main(["--help"]) == 0
    assert str(handbook_folder())[:20] in capsys.readouterr().out.replace("\n", "")


@pytest.fixture
def printed(capsys, monkeypatch):
    """Run the command line where no terminal says how wide it is; its output, which fits."""
    monkeypatch.delenv("COLUMNS", raising=False)

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 0
        text = capsys.readouterr().out
        # A word that is longer than a line, such as a path, can't be broken.
        assert not [s for s in text.splitlines() if len(s) > 80 and " " in s.strip()]
        return text

    return run


def test_lists_and_whatever_can_be_shown(printed):
    listed = [name for kind in ("model", "method", "maneuver") for name in names(kind)]
    listed += data_names("studies")
    text = printed("list")
    for name in listed:
        assert f"  {name}" in text
    for name in [*listed, *SCHEMAS]:
        printed("show", name)


def test_simulations_and_studies(printed, tmp_path):
    for model in names("model"):
        for arguments in ([], ["--method", "pod", "--all-outputs"]):
            assert "nan" not in printed("simulate", model, *arguments)
    printed("run", "figures-6-7", "--results", tmp_path)


def test_help(printed):
    for command in ([], *([command] for command in COMMANDS)):
        printed(*command, "--help")

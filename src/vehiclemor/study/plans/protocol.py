"""Studies with bounds: training, validation and test scenarios of a model, and who competes."""

import itertools
from dataclasses import dataclass
from pathlib import Path

from vehiclemor.errors import FileError, GeometryError, InputError, PlugInError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.interface import Method
from vehiclemor.registry import choice, component
from vehiclemor.resources import data_names
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import Experiment, make_experiment
from vehiclemor.study.method_settings import Settings, complete_settings
from vehiclemor.study.plans.loading import study_path
from vehiclemor.study.plans.study_file import (
    DRAWN,
    SETS,
    Box,
    Draw,
    Group,
    MethodEntry,
    StudyFile,
)
from vehiclemor.study.scenario import Scenario, check, own_speed
from vehiclemor.toml_files import read_toml

FULL_ORDER, CONTENDER = "full order", "contender"
# Of the names of the package's own; the model follows.
PREFIX = "predictive-"


@dataclass(frozen=True)
class Entry:
    """A method with the settings among which it may choose, and what it may learn from."""

    label: str
    method: str
    role: str
    candidates: tuple[Settings, ...]
    training: tuple[Scenario, ...]

    def experiment(self, model: Model, candidate: int, test: tuple[Scenario, ...]) -> Experiment:
        """A candidate, tested on some scenarios."""
        settings = self.candidates[candidate]
        return make_experiment(model, self.method, settings, self.training, test, "errors")

    @property
    def row_labels(self) -> list[str]:
        """Labels of its rows."""
        if self.role != FULL_ORDER:
            return [self.label]
        return [self.row_label(candidate) for candidate in range(len(self.candidates))]

    def row_label(self, candidate: int) -> str:
        """Label of a candidate's row; of a full-order method every candidate has its own."""
        if self.role != FULL_ORDER:
            return self.label
        tolerance = f"{float(self.candidates[candidate].get('tolerance', 0.0)):.1e}"
        return f"{self.label} {tolerance.replace('.0e', 'e').replace('e-0', 'e-')}"


@dataclass(frozen=True)
class Protocol:
    """A study with bounds, with all names resolved.

    Attributes
    ----------
    sets
        Name of `SETS` -> scenarios.
    seed
        Of the drawn runs: the file's, or another one for an audit.
    """

    path: Path
    definition: StudyFile
    model: Model
    sets: dict[str, tuple[Scenario, ...]]
    entries: tuple[Entry, ...]
    seed: int

    @property
    def study(self) -> str:
        """Name of its results; an audit's are apart."""
        audit = "" if self.seed == self.definition.seed else f"-seed-{self.seed}"
        return f"{self.path.stem}{audit}"

    @property
    def test_set(self) -> str:
        """Name of its drawn test set, with the seed."""
        return f"{self.path.stem}-{self.definition.version}, seed {self.seed}"


def protocol_names() -> dict[str, str]:
    """Model -> name of the study with bounds that the package has of it."""
    known = (name for name in data_names("studies") if name.startswith(PREFIX))
    return {name.removeprefix(PREFIX): name for name in known}


def load_protocol(study: str, seed: int | None = None) -> Protocol:
    """A study with bounds, by name or TOML file.

    Parameters
    ----------
    seed
        Of the drawn runs, for an audit; by default that of the file.

    Raises
    ------
    VehiclemorError
        If the file or anything that it names is wrong.
    """
    path = study_path(study)
    definition = read_toml(path, StudyFile)
    if not definition.bounds:
        raise FileError(f"{path}: has no bounds")
    try:
        return _resolved(path, definition, definition.seed if seed is None else seed)
    except PlugInError:
        raise
    except (GeometryError, InputError) as error:
        raise FileError(f"{path}: {error}") from None


def _resolved(path: Path, definition: StudyFile, seed: int) -> Protocol:
    model = build(definition.model)
    outputs = [*definition.bounds, *definition.reported, *definition.sensitive]
    if definition.straight:
        outputs.append(definition.straight.output)
    for output in outputs:
        choice(f"output of {model.name}", output, model.outputs)
    sets = {key: _scenarios(model, key, definition) for key in SETS}
    _check_apart(sets)
    _check_boxes(model, definition)
    entries = tuple(_entry(model, e, sets) for e in definition.methods)
    labels = [label for entry in entries for label in entry.row_labels]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"label {label!r} is used twice (of full order with the tolerance)")
    if definition.straight:
        _check_driven(definition, definition.straight.maneuver)
    for target in definition.targets:
        known = ["equal accuracy", "within bounds", *labels]
        choice("row that a target is against", target.against, known)
    return Protocol(path, definition, model, sets, entries, seed)


def _scenarios(model: Model, key: str, definition: StudyFile) -> tuple[Scenario, ...]:
    """Scenarios of one set, checked against the model."""
    found: list[Scenario] = []
    for number, group in enumerate(getattr(definition, key), start=1):
        try:
            found += _of_group(model, group)
        except InputError as error:
            raise type(error)(f"{key}, group {number}: {error}") from None
    return tuple(found)


def _of_group(model: Model, group: Group) -> list[Scenario]:
    """Every point of a group from every start."""
    maneuver: Maneuver = component("maneuver", group.maneuver)
    own = own_speed(model)
    speeds = group.speed or [own]
    products = itertools.product(group.frequency or [1.0], group.amplitude or [1.0], speeds)
    found: list[Scenario] = []
    for point in group.points or products:
        frequency, amplitude, speed = (*point, own)[:3]
        perturbed = maneuver.perturbed(frequency or 0.0, amplitude or 0.0)
        for start in group.start or model.starts[:1]:
            scenario = Scenario(perturbed, start, None if speed is None else float(speed))
            check(model, scenario)
            found.append(scenario)
    return found


def _check_apart(sets: dict[str, tuple[Scenario, ...]]) -> None:
    """No run stands twice: what a method has learned from or was chosen by can't test it."""
    seen: dict[tuple, str] = {}
    for key in SETS:
        for scenario in sets[key]:
            run = scenario.run_key
            if run in seen:
                raise InputError(f"{key}: the scenario ({scenario.label}) is in {seen[run]} too")
            seen[run] = key


def _check_boxes(model: Model, definition: StudyFile) -> None:
    """Raise `InputError` if a corner of a box is no scenario of the model."""
    for purpose in DRAWN:
        draw: Draw | None = getattr(definition, purpose)
        for number, box in enumerate(draw.boxes if draw else (), start=1):
            try:
                _check_corners(model, box)
            except InputError as error:
                raise type(error)(f"{purpose}, box {number}: {error}") from None


def _check_driven(definition: StudyFile, maneuver: str) -> None:
    """Raise `InputError` if no test run is of a maneuver."""
    boxes = [box for name in DRAWN if (d := getattr(definition, name)) for box in d.boxes]
    known = {part.maneuver for part in (*definition.test, *definition.outside, *boxes)}
    choice("maneuver of a test, in straight", maneuver, sorted(known))


def _check_corners(model: Model, box: Box) -> None:
    maneuver: Maneuver = component("maneuver", box.maneuver)
    for start in box.start:
        choice(f"start of {model.name}", start, model.starts)
    for frequency in box.frequency:
        for speed in box.speed or [None]:
            for amplitude in box.amplitude:
                corner = maneuver.perturbed(frequency, amplitude)
                check(model, Scenario(corner, (box.start or model.starts)[0], speed))


def _entry(
    model: Model,
    entry: MethodEntry,
    sets: dict[str, tuple[Scenario, ...]],
) -> Entry:
    method: Method = component("method", entry.method)
    label = entry.label or entry.method
    where = f"method {label!r}"
    candidates: list[Settings] = []
    for given in entry.candidates:
        own: dict[str, object] = dict(given)
        preset = str(own.pop("preset", entry.preset))
        settings = {**entry.settings, **own}
        complete = complete_settings(model, entry.method, settings, preset)
        # Of a method that refuses the model all candidates are empty.
        if complete in candidates and method.accepts(model)[0]:
            raise InputError(f"{where} has the same candidate twice")
        candidates.append(complete)
    known = {scenario.maneuver.name for scenario in sets["training"]}
    learned = [entry.training] if isinstance(entry.training, str) else entry.training
    learned = [name for name in learned if name]
    for name in learned:
        choice(f"maneuver in the training of {where}", name, known)
    training = tuple(s for s in sets["training"] if not learned or s.maneuver.name in learned)
    return Entry(label, entry.method, entry.role, tuple(candidates), training)

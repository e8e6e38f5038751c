"""Studies with bounds: training, validation and test scenarios of a model, and who competes.

Sampled test runs follow from the file alone: its seed, its version and its boxes.  Every machine
and every commit gets the same runs, whatever methods compete on them.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vehiclemor.exceptions import FileError, GeometryError, InputError, PlugInError
from vehiclemor.files import data_names
from vehiclemor.inputs.signal import Signal
from vehiclemor.registry import choice
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.experiment import Experiment, Settings, complete_settings, make_experiment
from vehiclemor.study.plans.loading import load_studies, read_study, study_path
from vehiclemor.study.plans.logs import Log, windows
from vehiclemor.study.plans.study_file import DRAWN, SETS, ProtocolEntry, ProtocolFile
from vehiclemor.study.plans.study_runs import DECIMALS, Box, Draw, Group
from vehiclemor.study.scenario import Scenario, check, overrides, own_speed

FULL_ORDER, CONTENDER = "full order", "contender"
# Of the names of those in the package; the model follows.
PREFIX = "predictive-"
# Samples tried for each run before a box counts as too small.
TRIES = 100

Scenarios = tuple[Scenario, ...]


@dataclass(frozen=True)
class Entry:
    """A method with the settings among which it may choose, and what it may learn from."""

    label: str
    method: str
    role: str
    candidates: tuple[Settings, ...]
    training: Scenarios

    def experiment(self, model: Model, candidate: int, test: Scenarios) -> Experiment:
        """A candidate, tested on some scenarios."""
        settings = self.candidates[candidate]
        return make_experiment(model, self.method, settings, self.training, test, "errors")

    def experiments(self, model: Model, test: Scenarios) -> list[Experiment]:
        """All candidates, tested on some scenarios."""
        return [self.experiment(model, number, test) for number in range(len(self.candidates))]

    @property
    def row_labels(self) -> list[str]:
        """Labels of its rows."""
        numbers = range(len(self.candidates) if self.role == FULL_ORDER else 1)
        return [self.row_label(number) for number in numbers]

    def row_label(self, candidate: int) -> str:
        """Label of a candidate's row; of a full-order method every candidate has one."""
        if self.role != FULL_ORDER:
            return self.label
        tolerance = f"{float(self.candidates[candidate].get('tolerance', 0.0)):.1e}"
        return f"{self.label} {tolerance.replace('.0e', 'e').replace('e-0', 'e-')}"


@dataclass(frozen=True)
class Protocol:
    """A study with bounds, with all names resolved; `seed` may be another one, for an audit.

    `study` is the name of its results; an audit's are apart.
    """

    study: str
    path: Path
    definition: ProtocolFile
    model: Model
    sets: dict[str, Scenarios]
    entries: tuple[Entry, ...]
    seed: int

    @property
    def test_set(self) -> str:
        """Name of its sampled test set, with the seed; that of the study that it extends."""
        name = Path(self.definition.extends or self.path).stem
        return f"{name}-{self.definition.version}, seed {self.seed}"

    @property
    def screened(self) -> list[str]:
        """Sets whose runs nobody has chosen one by one: in some the full order may be sensitive."""
        return [name for name, runs in self.sets.items() if any(map(_measured, runs))] + [*DRAWN]

    def timed_runs(self, runs: int) -> list[int]:
        """Numbers of the runs of a set that are timed: all, or so many evenly spread over it."""
        timed = min(self.definition.timed or runs, runs)
        return np.linspace(0, runs - 1, timed).round().astype(int).tolist()


def protocol_names() -> dict[str, str]:
    """Model -> name of the study with bounds that the package has of it."""
    protocols = [name for name in data_names("studies") if name.startswith(PREFIX)]
    models = {name.removeprefix(PREFIX): name for name in protocols}
    # Names of further test sets end in -2, and the like.
    return {model: name for model, name in models.items() if model.isidentifier()}


def load_protocol(study: str, seed: int | None = None, name: str = "") -> Protocol:
    """A study with bounds, by name or TOML file; for an audit, with another seed.

    `name` is that of its results, by default that of the file.
    """
    path = study_path(study)
    definition = read_study(path)
    if not isinstance(definition, ProtocolFile):
        raise FileError(f"{path}: has no bounds")
    name = name or path.stem
    seed = definition.seed if seed is None else seed
    if seed != definition.seed:
        name += f"-seed-{seed}"
    try:
        return _resolved(name, path, definition, seed)
    except PlugInError:
        raise
    except (GeometryError, InputError) as error:
        raise FileError(f"{path}: {error}") from None


def _resolved(study: str, path: Path, definition: ProtocolFile, seed: int) -> Protocol:
    model = build(definition.model, overrides=definition.parameters)
    straight = definition.straight
    outputs = [*definition.bounds, *definition.reported, *definition.sensitive]
    for output in [*outputs, straight.output] if straight else outputs:
        choice(f"output of {model.name}", output, model.outputs)
    sets: dict[str, Scenarios] = {}
    for key in SETS:
        sets[key] = ()
        for number, group in enumerate(getattr(definition, key), start=1):
            make = partial(_of_group, model, group, path.parent)
            sets[key] += _checked(model, f"{key}, group {number}", make)
    if definition.drawn_training:
        # An audit with another seed tests what has learnt the same.
        seeds = definition.seed, definition.version, len(DRAWN)
        sets["training"] += sampled_runs(model, definition.drawn_training, seeds)
    seen: dict[tuple, str] = {}
    run_labels: set[str] = set()
    for key, part in sets.items():
        for scenario in part:
            # What a method has learned from or was chosen by can't test it.
            run = scenario.run_key
            # Windows of logs may be alike, such as two without steering.
            if run in seen and not (_measured(scenario) and seen[run] == key):
                raise InputError(f"{key}: the scenario ({scenario.label}) is in {seen[run]} too")
            seen[run] = key
            if scenario.label in run_labels:
                raise InputError(f"{key}: ({scenario.label}) are two runs: give one log a name")
            run_labels.add(scenario.label)
    draws = definition.draws
    if definition.drawn_training:
        draws |= {"drawn_training": definition.drawn_training}
    for key, draw in draws.items():
        for number, box in enumerate(draw.boxes, start=1):
            _checked(model, f"{key}, box {number}", partial(_corners, model, box))
    entries = tuple(_entry(model, entry, sets["training"]) for entry in definition.methods)
    labels = [label for entry in entries for label in entry.row_labels]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"label {label!r} is used twice (of full order with the tolerance)")
    if straight:
        boxes = [box for draw in definition.draws.values() for box in draw.boxes]
        driven = {part.maneuver for part in (*definition.test, *definition.outside, *boxes)}
        choice("maneuver of a test, in straight", straight.maneuver, sorted(driven))
    for target in definition.targets:
        known = ["equal accuracy", "within bounds", *labels]
        if definition.extends and target.against not in known:
            (base,) = load_studies(definition.extends).values()
            raise InputError(
                f"a target is against {target.against!r}, a row of {definition.extends}: "
                f"rows is needed and must name its method, of {', '.join(base.labelled)}"
            )
        choice("row that a target is against", target.against, known)
    return Protocol(study, path, definition, model, sets, entries, seed)


def _measured(scenario: Scenario) -> bool:
    return isinstance(scenario.maneuver, Signal)


def _checked(model: Model, where: str, make: Callable[[], list[Scenario]]) -> Scenarios:
    """Scenarios of a part of a file, in which the model can be run."""
    try:
        scenarios = tuple(make())
        for scenario in scenarios:
            check(model, scenario)
    except InputError as error:
        raise type(error)(f"{where}: {error}") from None
    return scenarios


def _of_group(model: Model, group: Group | Log, folder: Path = Path()) -> list[Scenario]:
    """Every point of a group from every start, or every window of a log of a folder."""
    if isinstance(group, Log):
        return windows(model, group, folder)
    lists = group.frequency or [1.0], group.amplitude or [1.0]
    # A point may leave the speed to the model.
    speeds = [[speed] for speed in group.speed] or [[]]
    products = itertools.product(*lists, speeds)
    points = group.points or [[frequency, size, *speed] for frequency, size, speed in products]
    samples = itertools.product(*group.parameters.values())
    tables = [overrides(dict(zip(group.parameters, sample, strict=True))) for sample in samples]
    usual_speed = own_speed(model)
    return [
        Scenario.of(group.maneuver, point[:2], start, point[2] if point[2:] else usual_speed, table)
        for point in points
        for start in group.start or model.starts[:1]
        for table in tables
    ]


def _corners(model: Model, box: Box) -> list[Scenario]:
    """Scenarios of the corners of a box, and one of every start, end of members and parameters."""
    starts, speeds = box.start or list(model.starts[:1]), box.speed or [None]
    factors = list(itertools.product(box.frequency, box.amplitude))
    low = overrides({name: limits[0] for name, limits in box.parameters.items()})
    high = overrides({name: limits[1] for name, limits in box.parameters.items()})
    members = [f"{box.maneuver}:{number}" for number in box.members or ()] or [box.maneuver]
    corners = itertools.product(members[:1], factors, starts[:1], speeds, [low])
    others = itertools.product(members[:1], factors[:1], starts[1:], speeds[:1], [low])
    further = [(members[-1], factors[-1], starts[0], speeds[-1], high)]
    return [Scenario.of(*corner) for corner in (*corners, *others, *further)]


def _entry(model: Model, entry: ProtocolEntry, training: Scenarios) -> Entry:
    where = f"method {entry.name!r}"
    candidates: list[Settings] = []
    for candidate in entry.candidates:
        settings = {**entry.settings, **candidate}
        preset = str(settings.pop("preset", entry.preset))
        complete = complete_settings(model, entry.method, settings, preset)
        # Of a method that refuses the model all candidates are empty.
        if complete and complete in candidates:
            raise InputError(f"{where} has the same candidate twice")
        candidates.append(complete)
    learned = [entry.training] if isinstance(entry.training, str) else entry.training
    learned = [*filter(None, learned)]
    known = {scenario.maneuver.name for scenario in training}
    for name in learned:
        choice(f"maneuver in the training of {where}", name, known)
    runs = tuple(run for run in training if not learned or run.maneuver.name in learned)
    return Entry(entry.name, entry.method, entry.role, tuple(candidates), runs)


def sampled_sets(protocol: Protocol) -> dict[str, Scenarios]:
    """Sampled sets by name; none of their runs is one of training or validation."""
    # What is listed for other ends may be sampled again: else a list could strike runs from a set.
    known = [*protocol.sets["training"], *protocol.sets["validation"]]
    sets: dict[str, Scenarios] = {}
    for number, name in enumerate(DRAWN):
        if draw := getattr(protocol.definition, name):
            seeds = protocol.seed, protocol.definition.version, number
            try:
                sets[name] = sampled_runs(protocol.model, draw, seeds, known)
            except InputError as error:
                raise FileError(f"{protocol.path}: {error}") from None
            known += sets[name]
    return sets


def sampled_runs(
    model: Model, draw: Draw, seeds: Sequence[int], known: Sequence[Scenario] = ()
) -> Scenarios:
    """Different scenarios of some boxes, none of them known; the same wherever the seeds are.

    `InputError` if the boxes hold too few.
    """
    # Of the generator only `random` is used: NumPy may change how the other functions sample.
    generator = np.random.Generator(np.random.PCG64(seeds))
    shares = np.cumsum([box.share for box in draw.boxes])
    seen = {scenario.run_key for scenario in known}
    runs: list[Scenario] = []
    for _ in range(TRIES * draw.runs):
        share = generator.random() * shares[-1]
        box = draw.boxes[int(np.searchsorted(shares, share, side="right"))]
        scenario = _sampled_run(model, box, generator.random)
        if scenario.run_key not in seen:
            seen.add(scenario.run_key)
            runs.append(scenario)
        if len(runs) == draw.runs:
            return tuple(runs)
    raise InputError(f"the boxes hold fewer than {draw.runs} different runs")


def _sampled_run(model: Model, box: Box, random: Callable[[], float]) -> Scenario:
    def within(limits: Sequence[float]) -> float:
        low, high = limits
        return round(low + (high - low) * random(), DECIMALS)

    frequency, amplitude = within(box.frequency), within(box.amplitude)
    if random() < 0.5 and box.both_signs:
        amplitude = -amplitude
    speed = own_speed(model) if box.speed is None else within(box.speed)
    starts = box.start or model.starts[:1]
    start = starts[int(random() * len(starts))]
    # What came later is drawn after all else, where it is asked for: draws before stay the same.
    maneuver = box.maneuver
    if box.members:
        first, last = box.members
        maneuver += f":{first + int(random() * (last + 1 - first))}"
    table = overrides({name: within(box.parameters[name]) for name in sorted(box.parameters)})
    return Scenario.of(maneuver, (frequency, amplitude), start, speed, table)

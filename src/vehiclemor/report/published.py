"""What the paper prints: its numbers, each with its page; verdicts on ours; how to cite."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import version
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import xarray as xr

from vehiclemor.files import data_folder
from vehiclemor.registry import component, names
from vehiclemor.report.labels import timing_cases
from vehiclemor.report.results import at_point
from vehiclemor.study.plans.loading import load_studies
from vehiclemor.toml_files import FileSchema, Line, read_toml, toml_content

# Models of the paper: it says nothing about others in the registry.
Model = Literal["independent_suspension_vehicle", "double_wishbone", "high_fidelity_vehicle"]
NOMINAL_ERROR = "nominal-only: trained on the run that it is tested on, where replay is exact"
SAVED = "share of the time of {} that is saved; the paper names neither its {} nor its machine"
OF_INTEGRATION = SAVED.format("the same integrator's full run at equal tolerance", "integrator")
OF_ITERATION = SAVED.format("Newton with fresh Jacobians and generated elimination", "solver")
MET, MISSED, NOT_COMPARABLE = "met", "missed", "not_comparable"
VERDICTS = {MET: "met", MISSED: "missed", NOT_COMPARABLE: "not comparable"}
# Interquartile range of the rounds of a timing over their median, above which a time decides
# nothing: half of the runs lie up to a fifth apart.
LARGEST_SPREAD = 0.2
# Curves that agree within this share of the range lie on top of each other: 0.4 mm on a curve that
# is 40 mm high.
INDISTINGUISHABLE = 0.01
# Label of a method in the paper's studies -> what its rows are called.
VARIANTS = {"pod": "default", "pod_literal": "literal"}
# Of the timing of a model, beside those of studies.
TIMING = {model: f"timing-{model}" for model in get_args(Model)}
# Studies and timings by name.
Results = Mapping[str, xr.Dataset]


class Printed(FileSchema):
    """One thing that the paper prints, and where."""

    id: str
    page: str
    section: str
    figure: int | None = None


class Number(Printed):
    """A printed number, and the settings behind it, as far as the paper prints them.

    A time reduction is 1 - reduced time / full time, a perturbation the relative increase of the
    input's frequency or amplitude; `note` says how the printed words were read.
    """

    model: Model
    kind: Literal["rms_error", "time_reduction", "setting", "perturbation"]
    item: Line
    quantity: str = ""
    value: float
    unit: Line
    states: int | None = None
    control_period: float | None = None
    snapshots: int | None = None
    note: Line | None = None


class Published(FileSchema):
    """Schema of `data/published/masoudi2015.toml`: the paper's numbers."""

    number: list[Number]


@cache
def load_published() -> dict[str, Number]:
    """What the paper prints by id, in the order of the file."""
    file = read_toml(data_folder() / "published" / "masoudi2015.toml", Published)
    return {number.id: number for number in file.number}


def rms_numbers(model: str) -> dict[str, Number]:
    """Published RMS errors of a model by the output that they are about; none for a plug-in's."""
    numbers = load_published().values()
    return {n.quantity: n for n in numbers if n.model == model and n.kind == "rms_error"}


def fixed_test_sets() -> dict[str, str]:
    """Digests of the fixed test sets by their names."""
    return toml_content(data_folder() / "published" / "test_sets.toml")["test_sets"]


def citations() -> str:
    """BibTeX of the suite and the paper, the fixed test sets, and the methods' references."""
    text = (data_folder() / "published" / "citations.bib").read_text(encoding="utf-8")
    references = {name: component("method", name).reference for name in names("method")}
    lines = [f"test set {name}: digest {digest}" for name, digest in fixed_test_sets().items()]
    lines += [f"method {name}: doi:{doi}" for name, doi in references.items() if doi]
    return "\n".join([text.replace("VERSION", version("vehiclemor")), *lines])


# Ours beside the paper's.


def judged(within: bool | None) -> str:
    """Verdict on a number that is within its bound or not, or can't be compared."""
    return {True: MET, False: MISSED, None: NOT_COMPARABLE}[within]


def scatter(spreads: Mapping[str, float]) -> str:
    """Why times can't be compared, by the spreads of their rounds; empty if they can."""
    wide = [f"{name} {100 * s:.0f} %" for name, s in spreads.items() if not s <= LARGEST_SPREAD]
    if not wide:
        return ""
    return (
        f"the rounds scatter by more than {100 * LARGEST_SPREAD:.0f} % (interquartile range over "
        f"median): {', '.join(wide)}; run again on an idle machine"
    )


def counted(verdicts: Iterable[str]) -> str:
    """How many rows there are of each verdict, as text."""
    number = Counter(verdicts)
    return ", ".join(f"{number[v]} {text}" for v, text in VERDICTS.items() if v in number)


def of_paper(name: str) -> str:
    """Study of the paper's nominal run of a model, the first of its collection; else empty."""
    studies = load_studies("paper").items()
    return next((study for study, definition in studies if definition.model == name), "")


class Finding(NamedTuple):
    """A number that stands beside a printed one or a claim, its bound, and whether it is met.

    That is None if it can't be judged.  `measure` says what the number is, `reason` what else was
    seen.  An error has beside it that of the best approximation in the subspaces (`floor`) and the
    RMS of the signal (a bound above that is empty: zero would meet it); a time the time over that
    of the `strongest` full-order solver.
    """

    reproduced: float
    bound: float
    within: bool | None
    measure: str
    reason: str = ""
    unit: str = ""
    floor: float = math.nan
    signal_rms: float = math.nan
    strongest: float = math.nan


def printed_errors_and_savings() -> list[Number]:
    """Printed errors, then savings of time."""
    numbers = load_published().values()
    compared = [n for n in numbers if n.kind in ("rms_error", "time_reduction")]
    return sorted(compared, key=lambda number: number.kind)


def number_rows(results: Results) -> Iterator[dict[str, Any]]:
    """A row for each printed number and variant of the method."""
    for number in printed_errors_and_savings():
        item = f"{number.item} (figure {number.figure})" if number.figure else number.item
        head = {"id": number.id, "model": number.model, "item": item, "published": number.value}
        is_error = number.kind == "rms_error"
        replay = judge_rms_error(number, results, "replay").reproduced if is_error else math.nan
        for label, variant in VARIANTS.items():
            if not is_error and not case_of(number, label):
                continue
            judge = judge_rms_error if is_error else time_saved
            finding = judge(number, results, label)
            outcome = {"variant": variant, "verdict": judged(finding.within), "replay": replay}
            yield head | outcome | finding._asdict()


def judge_rms_error(number: Number, results: Results, label: str) -> Finding:
    """RMS error of the nominal run, with the paper's number of states."""
    study = results[of_paper(number.model)].sel(rank=number.states, output=number.quantity)
    point = at_point(study, label)
    reproduced, status = float(point["rms_error"]), str(point["status"].item())
    if "iterations" in study:
        counts = f"{int(point['iterations'])} iterations"
    else:
        full = int(at_point(study, "full_order")["rhs_calls"])
        counts = f"{int(point['rhs_calls'])} evaluations against {full} of the full model"
    failed = "" if status == "ok" else f"{status}: {point['message'].item()}; "
    signal = point["reference_outputs"].values
    return Finding(
        reproduced,
        number.value,
        status == "ok" and reproduced <= number.value,
        NOMINAL_ERROR,
        failed + counts,
        number.unit,
        floor=float(point["floor_rms_error"]),
        signal_rms=float(np.sqrt(np.mean(signal**2))),
    )


def time_saved(number: Number, results: Results, label: str) -> Finding:
    """Share of the baseline's time that is saved.

    It counts where the errors of the same run are within the published ones (of six states: those
    of three, since the paper prints none), and where the times don't scatter.
    """
    timing = results[TIMING[number.model]]
    case = case_of(number, label)
    run, full = timing.sel(case=case), timing.sel(case="baseline")
    saved = 1.0 - 1.0 / float(run["speed_up"])
    strongest = 1.0 / float(run["speed_up_strongest"])
    algebraic = "iterations" in timing
    count, name = ("iterations",) * 2 if algebraic else ("rhs_calls", "evaluations")
    beside = (
        f"{1.0 - saved:.2f} times the time of {'Newton' if algebraic else 'the same integrator'}, "
        f"{int(run[count])} {name} against {int(full[count])}; "
        f"{strongest:.2f} times that of the best full-order solver"
    )
    wrong = _missed_errors(number.model, run)
    scattered = "" if wrong else timing_scatter(timing, case, "baseline")
    beside = beside if run["status"].item() == "ok" else ""
    return Finding(
        saved,
        number.value,
        None if scattered else not wrong and saved >= number.value,
        OF_ITERATION if algebraic else OF_INTEGRATION,
        "; ".join(filter(None, (wrong, scattered, beside))),
        number.unit,
        strongest=strongest,
    )


def case_of(number: Number, label: str) -> str:
    """Timing case of control-period POD with the number's states and nothing else set; or none."""
    preset = "recommended" if label == "pod" else "literal"
    wanted = "pod", preset, {"rank": number.states or 3}
    for case in timing_cases(component("model", number.model)):
        if (case.method, case.preset, case.settings) == wanted:
            return case.id
    return ""


def _missed_errors(model: str, run: xr.Dataset) -> str:
    """Which published errors a timed run misses, empty if none."""
    status = run["status"].item()
    if status != "ok":
        return f"no time is saved by a run that has {status}"
    missed: list[str] = []
    for output, number in rms_numbers(model).items():
        error = float(run["rms_error"].sel(output=output))
        if not error <= number.value:
            missed.append(f"{output} {error:.2g} of {number.value:.3g} {number.unit}")
    return f"counts only with errors that are met: {', '.join(missed)}" if missed else ""


def timing_scatter(timing: xr.Dataset, *cases: str) -> str:
    """Why the times of some cases can't be compared; empty if they can."""
    spread = (timing["seconds_upper"] - timing["seconds_lower"]) / timing["seconds"]
    return scatter({case: float(spread.sel(case=case)) for case in cases})

"""What tables and figures show of a model: outputs, costs to time, nominal study, paper's terms.

Data only.  What a model leaves empty follows from its kind, so that one that declares nothing still
gets every table: see `completed`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product

from vehiclemor.short_repr import ShortRepr

Value = float | int | str | bool


@dataclass(frozen=True)
class TimingCase:
    """One row of a cost table: a method with settings, run on the nominal maneuver.

    Attributes
    ----------
    id
        By which the row is known; `baseline` is the paper's kind of full-order run and `strongest`
        the best full-order solver, for every model.
    label
        As it is printed.
    method, preset, settings
        Registered name, one of its presets, and settings that differ from that.
    """

    id: str
    label: str
    method: str
    preset: str = "recommended"
    settings: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelReport(ShortRepr):
    """What tables and figures show of a model; what is empty follows from its kind.

    Attributes
    ----------
    outputs
        Whose errors are tabled; all by default.
    printed_outputs
        Whose errors stand beside the times where a table is printed; the first three by default.
    counts
        Counts of the solvers that are printed: name -> heading.
    timing
        Rows of the cost table, in order; it has `baseline` and `strongest`.
    baselines
        What the cases `baseline` and `strongest` are, in words.
    study
        Study of the nominal run; none by default.
    settings_study, settings_outputs
        Study over all settings of control-period POD, and the outputs that its table lists.
    bounds
        Output -> key of its published RMS error.
    paper_fixed
        Settings of control-period POD that the paper names.
    paper_open
        Settings that it leaves open -> values that are tried, in all combinations.
    """

    outputs: tuple[str, ...] = ()
    printed_outputs: tuple[str, ...] = ()
    counts: Mapping[str, str] = field(default_factory=dict)
    timing: tuple[TimingCase, ...] = ()
    baselines: tuple[str, str] = ("", "")
    study: str = ""
    settings_study: str = ""
    settings_outputs: tuple[str, ...] = ()
    bounds: Mapping[str, str] = field(default_factory=dict)
    paper_fixed: Mapping[str, Value] = field(default_factory=dict)
    paper_open: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)


REPLAY = TimingCase("replay", "replay", "replay")
STRONGEST = TimingCase("strongest", "full order, strongest", "full_order", "strongest")
ALGEBRAIC_BASELINES = (
    TimingCase("baseline", "full order, Newton", "full_order"),
    STRONGEST,
    TimingCase(
        "newton_1e-6", "full order, Newton, 1e-6", "full_order", settings={"tolerance": 1e-6}
    ),
    REPLAY,
)
DYNAMIC_BASELINES = (
    TimingCase("baseline", "full order, explicit", "full_order"),
    STRONGEST,
    TimingCase(
        "explicit_1e-3", "full order, explicit, 1e-3", "full_order", settings={"tolerance": 1e-3}
    ),
    TimingCase(
        "rodas4_1e-4",
        "full order, RODAS4, 1e-4",
        "full_order",
        settings={"solver": "rodas4", "tolerance": 1e-4},
    ),
    REPLAY,
)
# What the paper does not say of control-period POD.
ALGEBRAIC_OPEN: Mapping[str, tuple[Value, ...]] = {
    "test_space": ("least_squares", "galerkin"),
    "tolerance": (1e-12, 1e-8, 1e-6, 1e-5, 1e-4),
}
DYNAMIC_OPEN: Mapping[str, tuple[Value, ...]] = {
    "formulation": ("coordinates", "state"),
    "inner_product": ("energy", "euclidean"),
    "solver": ("dopri5", "rodas4"),
    "tolerance": (1e-6, 1e-4, 1e-3),
}
_ALGEBRAIC = ModelReport(
    counts={
        "iterations": "iter.",
        "residual_evaluations": "resid.",
        "jacobian_evaluations": "Jac.",
    },
    timing=ALGEBRAIC_BASELINES,
    baselines=("Newton with fresh Jacobians at 1e-12", "the strongest full-order solver"),
    paper_open=ALGEBRAIC_OPEN,
)
_DYNAMIC = ModelReport(
    counts={"rhs_calls": "RHS calls", "steps": "steps", "rejected_steps": "rej."},
    timing=DYNAMIC_BASELINES,
    baselines=("the explicit pair at 1e-6", "the W-method with one Jacobian"),
    paper_open=DYNAMIC_OPEN,
)
DEFAULTS = {"ae": _ALGEBRAIC, "ode": _DYNAMIC, "dae": _DYNAMIC}
LARGEST_DEFAULT_RANK = 3


def reduced_case(
    method: str,
    rank: int,
    preset: str = "recommended",
    tolerance: float | None = None,
    **more: Value,
) -> TimingCase:
    """Row of a reduced model; its label tells what differs from the recommended settings."""
    words = [method.replace("_", " "), *([preset] if preset != "recommended" else [])]
    label = " ".join([*words, *(str(value) for value in more.values()), f"r={rank}"])
    settings: dict[str, Value] = {"rank": rank, **more}
    if tolerance is not None:
        label += f", {tolerance:.0e}".replace("e-0", "e-")
        settings["tolerance"] = tolerance
    name = label.replace(",", "").replace("=", "").replace(" ", "_")
    return TimingCase(name, label, method, preset, settings)


def default_rank(coordinates: int) -> int:
    """Rank of the reduced models in the default rows: 3, but less than the coordinates."""
    return max(1, min(LARGEST_DEFAULT_RANK, coordinates - 1))


def completed(
    declared: ModelReport, kind: str, coordinates: int, outputs: tuple[str, ...]
) -> ModelReport:
    """What a model declares or else what follows from its kind, coordinates and outputs.

    The default rows are full-order solvers, replay, and POD both ways.
    """
    default, rank = DEFAULTS[kind], default_rank(coordinates)
    reduced = (("pod", "recommended"), ("pod", "literal"), ("fixed_basis", "recommended"))
    cases = [reduced_case(method, rank, preset) for method, preset in reduced]
    tabled = declared.outputs or outputs
    baseline, strongest = declared.baselines
    return replace(
        declared,
        outputs=tabled,
        printed_outputs=declared.printed_outputs or tabled[:3],
        counts=declared.counts or default.counts,
        timing=declared.timing or (*default.timing, *cases),
        baselines=(baseline or default.baselines[0], strongest or default.baselines[1]),
        paper_fixed=declared.paper_fixed or {"rank": rank},
        paper_open=declared.paper_open or default.paper_open,
    )


def paper_cases(report: ModelReport) -> Iterator[TimingCase]:
    """Both full-order cases, then control-period POD with all that the paper leaves open.

    The identifier and the label of a variant are the values that it sets.
    """
    yield TimingCase("baseline", "full order, the paper's kind", "full_order")
    yield STRONGEST
    varied = report.paper_open
    for values in product(*varied.values()):
        label = ", ".join(str(value) for value in values)
        chosen = {**report.paper_fixed, **dict(zip(varied, values, strict=True))}
        yield TimingCase(label, f"pod, {label}", "pod", settings=chosen)

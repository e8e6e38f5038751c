"""The seal of a draw: test runs that nobody can know before all that they test is settled.

The seed is a hash of everything that is tested: the source that computes and judges results, the
chosen settings and the chosen contender, the training and validation sets, the bounds and the
boxes.  Whoever changes a method gets another test.
"""

import hashlib
import json
from collections.abc import Sequence

from vehiclemor.codegen.cache import source_digest
from vehiclemor.study.plans.boxes import drawn
from vehiclemor.study.plans.choice import Row
from vehiclemor.study.plans.protocol import DRAWN, Protocol
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.scenario import Scenario, parameters_of

# Sets that models have learned from or were chosen by.
LEARNED = ("training", "validation")
# Source that decides what is drawn, run and timed, and how it is judged.
PLANS = ("boxes", "choice", "protocol", "protocol_file", "protocol_results")
RUNS = ("plans/protocol_run", "plans/seal", "plans/sensitive", "experiment", "timing", "workers")
JUDGING = (*(f"plans/{name}" for name in PLANS), *RUNS)


def rules(protocol: Protocol) -> str:
    """Hash of the bounds, the boxes and the rule of sensitive runs, for the model's parameters."""
    definition = protocol.definition
    content = definition.model_dump(include={"sensitive", "drawn", "drawn_outside"})
    content["bounds"] = {o: [b.measure, b.bound] for o, b in definition.bounds.items()}
    text = json.dumps([content, parameters_of(protocol.model)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def seal(protocol: Protocol, rows: Sequence[Row]) -> str:
    """Hash of all that a draw of this protocol tests, for the chosen candidates of its rows."""
    model = protocol.model
    content = {
        "model": [model.name, model.kernel_hash, parameters_of(model)],
        "rows": [
            [
                row.label,
                row.contestant.role,
                row.winner,
                row.contestant.candidates[row.candidate],
                code_digest(model.name, row.contestant.method),
                [scenario.content for scenario in row.contestant.training],
            ]
            for row in rows
        ],
        "validation": [scenario.content for scenario in protocol.sets["validation"]],
        "own": protocol.own,
        "judging": source_digest((), [f"study/{name}.py" for name in JUDGING], ()),
        "rules": rules(protocol),
    }
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def sealed_sets(protocol: Protocol, digest: str) -> dict[str, tuple[Scenario, ...]]:
    """Drawn sets of a protocol by name."""
    # What is listed for other ends may be drawn again: else a list could strike runs from a draw.
    known = [scenario for name in LEARNED for scenario in protocol.sets[name]]
    found: dict[str, tuple[Scenario, ...]] = {}
    for name in DRAWN:
        draw = getattr(protocol.definition, name)
        if draw is not None:
            found[name] = drawn(protocol.model, draw, digest, name, known)
            known += found[name]
    return found

"""The seal of a draw: test runs that nobody can know before all that they test is settled.

The seed is a hash of everything that is tested: the source that computes results, the chosen
settings, the training and validation sets, the bounds and the boxes.  Whoever changes a method gets
another test.
"""

import hashlib
import json
from collections.abc import Sequence

from vehiclemor.codegen.sources import source_digest
from vehiclemor.study.plans.boxes import drawn
from vehiclemor.study.plans.choice import Row
from vehiclemor.study.plans.protocol import DRAWN, SETS, Protocol
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.scenario import Scenario, parameters_of


def seal(protocol: Protocol, rows: Sequence[Row]) -> str:
    """Hash of all that a draw of this protocol tests, for the chosen candidates of its rows."""
    model, definition = protocol.model, protocol.definition
    content = {
        "model": [model.name, model.kernel_hash, parameters_of(model)],
        "rows": [
            [
                row.label,
                row.contestant.candidates[row.candidate],
                code_digest(model.name, row.contestant.method),
                [scenario.content for scenario in row.contestant.training],
            ]
            for row in rows
        ],
        "validation": [scenario.content for scenario in protocol.sets["validation"]],
        "boxes": source_digest((), ["study/plans/boxes.py"], ()),
        "rules": definition.model_dump(include={"bounds", "sensitive", "drawn", "drawn_outside"}),
    }
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def sealed_sets(protocol: Protocol, digest: str) -> dict[str, tuple[Scenario, ...]]:
    """Drawn sets of a protocol by name."""
    known = [scenario for name in SETS for scenario in protocol.sets[name]]
    found: dict[str, tuple[Scenario, ...]] = {}
    for name in DRAWN:
        draw = getattr(protocol.definition, name)
        if draw is not None:
            found[name] = drawn(protocol.model, draw, digest, name, known)
            known += found[name]
    return found

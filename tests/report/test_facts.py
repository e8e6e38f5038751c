"""The facts of the texts are what the paper's studies give when they are run afresh."""

import facts
import fragments
import pytest

from vehiclemor.study.plans.loading import load_studies


def test_studies_run_afresh_give_the_facts(results, results_folder):
    declared, known = fragments.manifest(), facts.stored_facts()["facts"]
    fresh = {*load_studies("paper"), "published"}
    names = {
        name
        for name, source in declared.sources.items()
        if name not in declared.varying and (source in fresh or source.startswith("operations"))
    }
    chosen = [e for e in known if set(facts.sources_of(e)) <= names]
    assert len(chosen) > 80
    loaded = {
        name: results[source]
        if (source := declared.sources[name]) in results
        else facts.load(source, results_folder, 1)
        for name in names
    }
    for expression in chosen:
        value, _ = facts.evaluate(expression, loaded)
        # The texts print up to three digits; the last bits of a run differ between processors.
        assert value == pytest.approx(known[expression]["value"], rel=2e-3), expression

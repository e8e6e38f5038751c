"""The table of errors of `vehiclemor compare MODEL`."""

import pandas as pd

from vehiclemor.report.comparison import model


def test_perturbed_errors_are_of_their_start_and_failures_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(model, "costs_text", lambda *_: "")
    monkeypatch.setattr(model, "predictive_text", lambda _: "")
    table = pd.DataFrame(
        [
            ("nominal", "pod", "equilibrium", "ok", 1e-6),
            ("nominal", "pod", "dropped", "ok", 2e-6),
            ("nominal", "path_map", "equilibrium", "ok", 3e-6),
            ("perturbed", "pod", "equilibrium", "ok", 4e-6),
            ("perturbed", "pod", "equilibrium", "ok", 5e-6),
            ("perturbed", "path_map", "equilibrium", "unreachable", float("nan")),
        ],
        columns=["kind", "label", "start", "status", "rms_second_euler_angle"],
    ).assign(effective_rank=3, message="", rms_spindle_y=0.0)
    text = model.model_text("double_wishbone", table, tmp_path)
    found = [line.split()[-2:] for line in text.splitlines() if line.split()[1:2] == ["3"]]
    assert found == [["1.0e-06", "5.0e-06"], ["3.0e-06", "failed"], ["2.0e-06", "-"]]

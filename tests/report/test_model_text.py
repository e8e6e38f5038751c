"""The table of errors of `vehiclemor compare MODEL`."""

import pandas as pd

from vehiclemor.report.comparison import screens


def test_perturbed_errors_are_of_their_start_and_failures_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(screens, "costs_text", lambda *_: "")
    monkeypatch.setattr(screens, "_predictive", lambda _: [])
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
    text = screens.comparison_text("double_wishbone", table, tmp_path)
    found = {
        (head, line.split()[0]): line.split()[-2:]
        for head, *lines in (part.splitlines() for part in text.split("\nstart ")[1:])
        for line in lines
        if line.split()[1:2] == ["3"]
    }
    angle = {key: errors for key, errors in found.items() if key[0].endswith("angle")}
    assert angle == {
        ("equilibrium: second euler angle", "pod"): ["1.0e-06", "5.0e-06"],
        ("equilibrium: second euler angle", "path_map"): ["3.0e-06", "failed"],
        ("dropped: second euler angle", "pod"): ["2.0e-06", "-"],
    }

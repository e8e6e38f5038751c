"""The figures of studies as data: what their texts, lines and limits are; and as files."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

from tests.report.figure_texts import checked, varied
from vehiclemor.exceptions import InputError
from vehiclemor.report.figures.errors import figure_errors, figure_pareto
from vehiclemor.report.figures.result_plot import draw, pictures_of
from vehiclemor.report.figures.runs import shown_outputs
from vehiclemor.report.figures.theme import panels, save_figure, styled
from vehiclemor.study.run import run_studies

PARETO = "predictive-double_wishbone"


FACTORS = np.linspace(0.7, 1.3, 7)
OUTPUTS = ("lateral_position", "yaw")


def grid_of(*labels):
    """Errors that a study over both factors could have, none at the nominal input of replay."""
    grid = varied(labels, OUTPUTS, amplitude_factor=FACTORS, frequency_factor=FACTORS)
    grid["rms_error"][3, 3] = 4.4e-7
    grid["rms_error"][3, 3, labels.index("replay")] = 0.0
    return grid


@pytest.fixture(scope="session")
def unseen_travels(small_protocol, tmp_path_factory):
    """Results of a small protocol, with a reduced model that fails and one that is chosen."""
    found = run_studies(str(small_protocol), tmp_path_factory.mktemp("unseen"))["unseen"]
    failing = found.sel(label=found["label"][-1:]).assign_coords(label=["failing"])
    failing = failing.assign(winner=failing["winner"] & False, status=failing["status"].copy())
    failing["status"][:] = "diverged"
    found = xr.concat([found, failing], "label", data_vars="minimal", join="outer")
    return found.assign_attrs(study=PARETO)


@pytest.fixture(scope="session")
def drawn(results, unseen_travels):
    """Every figure of the paper's studies, and one of each other kind, drawn."""
    with styled():
        figures = {}
        for study, dataset in results.items():
            figures |= {f"{study}-{kind}": draw(dataset, kind) for kind in pictures_of(dataset)}
        figures["grid"] = figure_errors(grid_of("pod", "replay"))
        figures["pareto"] = figure_pareto(unseen_travels)
        return {name: checked(figure) for name, figure in figures.items()}


def test_figures_of_largest_errors_show_the_rms_beside_the_published(drawn, results):
    run = results["figures-2-4"].sel({"label": "pod", "start": "equilibrium", "output": "pitch"})
    shown = shown_outputs(results["figures-2-4"])
    axis = drawn["figures-2-4-histories"].axes[len(shown) + 1 + shown.index("pitch")]
    marks = [line.get_ydata() for line in axis.lines if line.get_marker() == "<"]
    heights = [mark[0] for mark in marks if np.size(mark)]
    assert run["rms_error"].item() in heights
    (published,) = (x for x in axis.lines if x.get_label() == "published RMS error")
    low, high = axis.get_ylim()
    assert all(low < height < high for height in (*heights, published.get_ydata()[0]))
    error = abs(run["outputs"] - run["reference_outputs"]).squeeze()
    (line,) = (x for x in axis.lines if x.get_label() == "POD*")
    steps = [float(error.sel(time=slice(t + 1e-6, t + 0.5 + 1e-6)).max()) for t in (2.0, 2.5)]
    x, y = line.get_data()
    # Edges and heights of a stair, each height twice.
    stair = np.repeat(x, 2)[1:-1], np.repeat(y[:-1], 2)
    np.testing.assert_array_equal(np.interp([2.25, 2.75], *stair), steps)
    assert np.nanmax(line.get_ydata()) == float(error.max())


def test_files_have_fonts_texts_resolution_and_style(drawn, tmp_path):
    with styled():
        pdf, svg = (
            save_figure(drawn["figures-6-7-histories"], tmp_path / f"a.{end}")
            for end in ("pdf", "svg")
        )
    assert b"/Type3" not in pdf.read_bytes()
    assert b"/FontFile2" in pdf.read_bytes()
    assert ">time (s)</text>" in svg.read_text(encoding="utf-8")

    def drawn_with(style=""):
        with styled(style):
            return imread(save_figure(panels(1, 1, (1.0, 1.0))[0], tmp_path / "a.png"))

    assert drawn_with().shape == (200, 200, 4)
    assert drawn_with("dark_background").mean() < drawn_with().mean()
    assert matplotlib.rcParams["savefig.dpi"] == matplotlib.rcParamsDefault["savefig.dpi"]
    with pytest.raises(InputError, match="pdf, svg, png"):
        save_figure(panels(1, 1, (1.0, 1.0))[0], tmp_path / "a.gif")


def test_pareto_figure_shows_every_method(drawn, unseen_travels):
    axis = drawn["pareto"].axes[0]
    texts = axis.get_legend_handles_labels()[1]
    assert set(texts) == {"fixed basis (chosen)", "failing (fails)"}
    low, high = axis.get_ylim()
    assert all(low < line.get_ydata()[0] < high for line in axis.lines)
    chosen = next(c for c in axis.containers if c.get_label() == "fixed basis (chosen)")
    seconds = unseen_travels["seconds"].sel(label="fixed basis").mean().item()
    assert chosen.lines[0].get_xdata()[0] == pytest.approx(1e6 * seconds)
    worse = unseen_travels.assign(rms_error=unseen_travels["rms_error"] + 1e-4)
    axis = figure_pareto(worse).axes[0]
    assert "full order, newton" in axis.get_legend_handles_labels()[1]
    assert figure_pareto(worse.sel(label=["failing"])).axes

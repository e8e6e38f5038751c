"""Every figure as data: what its texts, lines and limits are."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import vehiclemor as vm
from tests.report.figure_texts import check_texts
from vehiclemor.cli import main
from vehiclemor.errors import InputError
from vehiclemor.report.figures.catalogue import FIGURES
from vehiclemor.report.figures.error_map import luminance
from vehiclemor.report.figures.pareto import figure_pareto
from vehiclemor.report.figures.result_plot import plot_result, shown_outputs
from vehiclemor.report.figures.theme import panels, save_figure, styled
from vehiclemor.report.labels import readable_unit
from vehiclemor.report.regenerate import left_out
from vehiclemor.study.netcdf_file import write_dataset
from vehiclemor.study.plans.protocol import load_protocol
from vehiclemor.study.run import run_studies

FREQUENCY, AMPLITUDE = np.linspace(0.7, 1.3, 7), np.linspace(0.7, 1.3, 7)
SCHEMATICS = {"1", "5", "8"}


def grid_of(entry):
    """Errors that a study over both factors could have, none at the nominal input of replay."""
    methods, outputs = list(entry.options["methods"]), entry.options["outputs"]
    shape = len(AMPLITUDE), len(FREQUENCY), len(methods), len(outputs)
    errors = 10.0 ** np.random.default_rng(1).uniform(-3.0, 0.5, shape)
    errors[3, 3] = 4.4e-4
    errors[3, 3, methods.index("replay")] = 0.0
    dimensions = ("amplitude_factor", "frequency_factor", "label", "output")
    units = ["m" if output in ("lateral_position", "spindle_y") else "rad" for output in outputs]
    places = {
        "amplitude_factor": AMPLITUDE,
        "frequency_factor": FREQUENCY,
        "label": methods,
        "output": list(outputs),
        "output_unit": ("output", units),
    }
    variables = {
        "rms_error": (dimensions, errors),
        "signal_range": (dimensions, np.ones(shape)),
        "status": (dimensions[:-1], np.full(shape[:-1], "ok")),
    }
    return xr.Dataset(variables, places, {"model": "double_wishbone"})


@pytest.fixture(scope="session")
def unseen_travels(small_protocol, tmp_path_factory):
    """Results of the small protocol."""
    return run_studies(str(small_protocol), tmp_path_factory.mktemp("unseen"))["unseen"]


def protocol_results(small, name):
    """Results that a protocol could have: as many rows and outputs, of those of a small one."""
    protocol = load_protocol(name)
    rows = [(label, c.method, c.role) for c in protocol.entries for label in c.row_labels]
    outputs = sorted({*protocol.definition.bounds, *protocol.definition.reported})
    labels, methods, roles = map(list, zip(*rows, strict=True))
    places = {"label": len(rows), "output": len(outputs)}
    found = small.isel({d: np.arange(n) % small.sizes[d] for d, n in places.items()})
    found = found.assign_coords(label=labels, output=outputs).copy(deep=True)
    by_row = {"method": methods, "role": roles, "settings": ["{}"] * len(rows)}
    by_row["series"] = [label.rsplit(" ", 1)[0] for label in labels]
    by_row["winner"] = np.arange(len(rows)) == roles.index("contender")
    found = found.assign({name: ("label", values) for name, values in by_row.items()})
    rng = np.random.default_rng(2)
    for variable in ("rms_error", "max_error"):
        found[variable][:] = 10.0 ** rng.uniform(-6.0, 1.0, found[variable].shape)
    seconds = 10.0 ** rng.uniform(-5.0, -2.0, found["seconds"].shape)
    for variable, factor in (("seconds", 1.0), ("seconds_lower", 0.9), ("seconds_upper", 1.2)):
        found[variable][:] = factor * seconds
    found["status"] = found["status"].astype(object)
    found["status"][-1, 0] = "diverged"
    found.attrs |= {
        "configuration": protocol.definition.model_dump_json(exclude_defaults=True),
        "study": name,
    }
    return found


def unseen(results):
    """Runs of the lane change under the names of those on unseen inputs."""
    runs = results["figures-2-4"].sel(start="equilibrium").isel(amplitude_factor=0, drop=True)
    parts = [runs.assign_coords(amplitude_factor=factor) for factor in (-1.2, 0.5, 0.0)]
    dataset = xr.concat(parts, "amplitude_factor", coords="different", compat="equals")
    manifold = dataset.sel(label=["pod_state"]).assign_coords(label=["slow_manifold"])
    return {"unseen-inputs": dataset, "unseen-inputs-trained": manifold}


@pytest.fixture(scope="session")
def drawn(results, unseen_travels):
    """Every figure of the catalogue, drawn."""
    figures = {}
    for name, entry in FIGURES.items():
        data = dict(results)
        if name.endswith("map"):
            data[entry.studies[0]] = grid_of(entry)
        elif entry.drawing == "pareto":
            data[entry.studies[0]] = protocol_results(unseen_travels, entry.studies[0])
        elif entry.drawing == "unseen inputs":
            data = unseen(results)
        with styled():
            figures[name] = entry.draw(data)
            FigureCanvasAgg(figures[name]).draw()
    return figures


@pytest.mark.parametrize("name", FIGURES)
def test_texts_are_on_the_canvas_and_apart(drawn, name):
    check_texts(drawn[name])


@pytest.mark.parametrize("name", sorted(set(FIGURES) - SCHEMATICS))
def test_axes_are_labelled_with_units_and_no_label_is_longer_than_its_axis(drawn, name):
    figure = drawn[name]
    for axis in figure.axes:
        label = axis.yaxis.label
        if label.get_text():
            units = ("(", "/", "energy")
            assert any(unit in label.get_text() for unit in units)
            assert label.get_window_extent().height <= axis.bbox.height
        if axis.get_xlabel():
            assert axis.xaxis.label.get_window_extent().width <= 1.1 * axis.bbox.width


@pytest.mark.parametrize("name", sorted(set(FIGURES) - SCHEMATICS))
def test_lines_differ_in_grey_too(drawn, name):
    for axis in drawn[name].axes:
        looks = {}
        for line in axis.lines:
            label = line.get_label()
            if label and not label.startswith("_") and line.get_linestyle() != "None":
                dashes = line._dash_pattern
                face = line.get_markerfacecolor() if line.get_marker() not in ("None", None) else ""
                grey = round(luminance(to_rgb(line.get_color())), 1), line.get_linewidth()
                look = str((dashes, line.get_marker(), face, grey))
                assert looks.setdefault(look, label) == label
    assert drawn[name].axes


def test_wheels_are_round(drawn):
    for name in ("1", "8"):
        lines = drawn[name].axes[0].lines
        wheels = [line for line in lines if np.size(line.get_data_3d()[0]) > 100]
        assert len(wheels) == 4
        for wheel in wheels:
            points = np.transpose(wheel.get_data_3d())
            away = np.linalg.norm(points - points[:-1].mean(axis=0), axis=1)
            np.testing.assert_allclose(away, away[0], rtol=1e-9)


def test_figures_of_largest_errors_show_the_rms_beside_the_published(drawn, results):
    run = results["figures-2-4"].sel({"label": "pod", "start": "equilibrium", "output": "pitch"})
    axis = drawn["4"].axes[0]
    marks = [
        line.get_ydata()[0]
        for line in axis.lines
        if line.get_marker() == "<" and line.get_ydata().size
    ]
    assert run["rms_error"].item() in marks
    (published,) = (x for x in axis.lines if x.get_label() == "published RMS error")
    low, high = axis.get_ylim()
    assert all(low < height < high for height in (*marks, published.get_ydata()[0]))
    assert "\nin each 0.5 s" in axis.get_ylabel()


def test_maps_hold_the_nominal_input_and_read_well(drawn):
    cells = [t for t in drawn["vehicle-map"].axes[0].texts if t.get_text()]
    assert len(cells) == 49
    assert {t.get_fontsize() for t in cells} == {7.0}
    assert not [t for t in cells if "e" in t.get_text()]
    mesh = drawn["vehicle-map"].axes[0].collections[0]
    colors = mesh.to_rgba(mesh.get_array()).reshape(-1, 4)
    for text, color in zip(cells, colors, strict=True):
        one, other = sorted((luminance(to_rgb(text.get_color())), luminance(color[:3])))
        assert (other + 0.05) / (one + 0.05) > 4.5


def test_readable_units():
    found = [readable_unit(*each) for each in ((2e-5, "rad"), (0.0, "m"), (1e-3, "N"))]
    assert found == [(1e6, "µrad"), (1.0, "m"), (1.0, "N")]


def test_styles_and_resolution(tmp_path):
    def drawn_with(style="", dpi=None):
        with styled(style, dpi):
            figure, _ = panels(1, 1, (1.0, 1.0))
            path = save_figure(figure, tmp_path / "a.png")
        return imread(path)

    plain = drawn_with()
    assert plain.shape == (200, 200, 4)
    assert drawn_with(dpi=50).shape == (50, 50, 4)
    assert drawn_with("dark_background").mean() < plain.mean()
    assert matplotlib.rcParams["savefig.dpi"] == matplotlib.rcParamsDefault["savefig.dpi"]
    for wrong in (("no-such-style", None), (3, None), ("", 5), ("", "a"), ("", float("nan"))):
        with pytest.raises(InputError):
            styled(*wrong)
    with pytest.raises(InputError, match="a figure is one of pdf, svg, png"):
        save_figure(panels(1, 1, (1.0, 1.0))[0], tmp_path / "a.gif")


def test_fonts_are_embedded_and_text_is_text(drawn, tmp_path):
    with styled():
        pdf, svg = (save_figure(drawn["6"], tmp_path / f"6.{end}") for end in ("pdf", "svg"))
    assert b"/Type3" not in pdf.read_bytes()
    assert b"/FontFile2" in pdf.read_bytes()
    assert ">time (s)</text>" in svg.read_text(encoding="utf-8")


def test_failed_runs_of_two_methods_do_not_hide_each_other(drawn, results):
    errors = results["equation-order"]["rms_error"]
    failed = int((~np.isfinite(errors.sel(output="spindle_y"))).sum())
    crosses = [line for line in drawn["equation-order"].axes[0].lines if line.get_marker() == "x"]
    places = {tuple(point) for line in crosses for point in np.reshape(line.get_xydata(), (-1, 2))}
    assert len(places) == failed > 2


def test_a_full_order_that_stands_still_does_not_hide_the_others(drawn):
    axis = drawn["vehicle-zero-steer"].axes[0]
    assert axis.get_ylabel() == "lateral position Y (m)"
    assert axis.get_ylim()[1] > 3.0


def test_pareto_figures_are_drawn_where_their_study_is_stored(
    unseen_travels, tmp_path, capsys, monkeypatch
):
    everything = dict(FIGURES)
    chosen = {"5": everything["5"], "pareto-suspension": everything["pareto-suspension"]}
    monkeypatch.setattr("vehiclemor.report.figures.catalogue.FIGURES", chosen)
    folders = ["--results", str(tmp_path), "--out", str(tmp_path / "figures")]
    assert main(["figures", *folders]) == 0
    assert "left out: pareto-suspension" in capsys.readouterr().out
    (tmp_path / "studies").mkdir(exist_ok=True)
    study = "predictive-double_wishbone"
    write_dataset(protocol_results(unseen_travels, study), tmp_path / "studies" / f"{study}.nc")
    assert left_out(tmp_path) == {}
    assert main(["figures", *folders]) == 0
    printed = capsys.readouterr().out
    assert "figure-pareto-suspension.pdf" in printed
    assert "left out" not in printed


@pytest.mark.parametrize(
    ("study", "place", "kind"),
    [
        ("figures-2-4", {"start": "dropped"}, "histories"),
        ("figures-2-4", {"start": "dropped"}, "paths"),
        ("figures-2-4", {"start": "dropped"}, "errors"),
        ("figures-6-7", {"rank": 3, "label": "full_order"}, "histories"),
        ("figure-13-frequency", {}, "errors"),
    ],
)
def test_pictures_of_results(results, study, place, kind):
    figure = plot_result(results[study].sel(place), None, kind)
    FigureCanvasAgg(figure).draw()
    check_texts(figure)
    assert figure.get_suptitle().startswith(results[study].attrs["title"][:20])
    assert figure.axes[-1].get_xlabel()


def test_a_picture_shows_both_runs_and_their_difference(results):
    run = results["figures-6-7"].sel({"label": "pod", "rank": 3}).squeeze(drop=False)
    figure = plot_result(run)
    upper, lower = figure.axes[0], figure.axes[2]
    angle = run.sel(output="second_euler_angle")
    full, reduced = angle["reference_outputs"], angle["outputs"]
    for line, outputs in zip(upper.lines, (full, reduced), strict=False):
        np.testing.assert_array_equal(line.get_ydata(), 1e3 * outputs)
    assert "mrad" in upper.get_ylabel()
    factor, unit = readable_unit(float(abs(full - reduced).max()), "rad")
    np.testing.assert_allclose(lower.lines[0].get_ydata(), factor * (reduced - full), atol=1e-9)
    assert unit in lower.get_ylabel()


@pytest.mark.parametrize(
    ("study", "kind", "words"),
    [
        ("figure-13-frequency", "histories", "no histories"),
        ("figures-2-4", "histories", "choose a point of the grid first: start"),
        ("figure-11", "paths", "double_wishbone has no path"),
    ],
)
def test_what_cannot_be_drawn_is_said(results, study, kind, words):
    with pytest.raises(InputError, match=words):
        plot_result(results[study].isel(rank=0), None, kind)


@pytest.mark.parametrize(
    "wrong", [{"kind": "curve"}, {"kind": 3}, {"rank": 99}, {"start": ["dropped"]}, {"r": 3}]
)
def test_wrong_kinds_and_points_are_refused(results, wrong):
    with pytest.raises(InputError):
        vm.plot(results["figures-2-4"], **wrong)


def test_errors_need_a_method_and_outputs(results):
    study = results["figure-11"].isel(rank=0)
    alone = study.sel({"label": ["full_order"]})
    for lacking in (alone, study.isel(output=slice(0)), study.drop_vars("signal_range")):
        with pytest.raises(InputError):
            plot_result(lacking, None, "errors")


def test_errors_over_settings_have_whole_ticks_and_a_line_for_each_input(results):
    study = results["figure-14"].sel({"label": ["pod"]})
    assert all(
        tick.is_integer() for tick in plot_result(study, None, "errors").axes[0].get_xticks()
    )
    other = study.assign_coords(frequency_factor=[1.0])
    other["rms_error"] = 0.1 * other["rms_error"]
    figure = plot_result(xr.concat([other, study], "frequency_factor"), None, "errors")
    assert figure.axes[-1].get_xlabel() == "frequency perturbation (%)"
    (legend,) = figure.legends
    ranks = {f"POD, rank {rank}" for rank in study["rank"].values}
    assert ranks <= {text.get_text() for text in legend.get_texts()}


def test_chosen_outputs_are_drawn_though_the_model_shows_others(results):
    point = results["figure-11"].isel(rank=0)
    others = [name for name in point["output"].values if name not in shown_outputs(point)][:1]
    figure = plot_result(point.sel(output=others))
    assert others == ["spindle_x"]
    assert figure.axes[0].get_ylabel().startswith("spindle displacement\nx")


def test_pareto_figure_of_methods_that_all_fail(unseen_travels):
    study = "predictive-double_wishbone"
    dataset = protocol_results(unseen_travels, study)
    dataset["status"][:] = "diverged"
    dataset["rms_error"][:] = dataset["max_error"][:] = np.inf
    assert figure_pareto({study: dataset}).axes


def test_a_study_stored_by_other_source_is_named(unseen_travels, tmp_path, capsys, monkeypatch):
    chosen = {"pareto-suspension": FIGURES["pareto-suspension"]}
    monkeypatch.setattr("vehiclemor.report.figures.catalogue.FIGURES", chosen)
    (tmp_path / "studies").mkdir()
    study = "predictive-double_wishbone"
    old = protocol_results(unseen_travels, study).drop_vars("seconds_upper")
    write_dataset(old, tmp_path / "studies" / f"{study}.nc")
    assert main(["figures", "--results", str(tmp_path), "--out", str(tmp_path / "figures")]) == 1
    printed = capsys.readouterr().err
    for words in ("pareto-suspension", "seconds_upper", "makes its study again"):
        assert words in printed

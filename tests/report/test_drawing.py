"""Studies that end in every way, over unequal axes, of one to seven methods: all are drawn."""

import json
from collections import Counter

import numpy as np
import pytest

import vehiclemor as vm
from tests.report import endings
from tests.report.figure_texts import check_texts
from vehiclemor.cli import main
from vehiclemor.errors import InputError
from vehiclemor.report.figures import result_plot, theme
from vehiclemor.report.figures.runs import PATH
from vehiclemor.study.netcdf_file import read_dataset

ENDS = ("ok", "untrusted", "diverged", "rejected", "unreachable", "error", "exact")
CURVE = "frequency_factor = [0.8, 1.0, 1.25]"
MAP = f"{CURVE}\namplitude_factor = [-0.5, 1.0, 1.2]"
# Factor of the amplitude -> of the runs beyond it none comes well to its end.
PARTLY = 0.08


def study(*ends, grid="", above=0.0, **entries):
    lines = ['title = "ends as it is told"', 'model = "double_wishbone"', 'training = "nominal"']
    lines += [f"{key} = {json.dumps(value)}" for key, value in entries.items()] + ["[grid]", grid]
    for number, end in enumerate(ends):
        settings = f'end = "{end}", above = {above}, off = {0.01 * (number + 1)}'
        lines += ["[[methods]]", 'method = "endings"', f'label = "{end}_{number}"']
        lines += [f"settings = {{ {settings} }}"]
    return "\n".join(lines)


# Each end alone, beside another over a curve, or on a map of few and of all methods.
STUDIES = {f"alone-{end}": study(end) for end in ("ok", "diverged", "unreachable", "error")}
STUDIES |= {
    f"beside-{end}": study(end, "ok", grid=CURVE)
    for end in ("untrusted", "diverged", "rejected", "exact")
}
STUDIES |= {f"map-{n}": study(*ENDS[:n], grid=MAP, above=PARTLY) for n in (1, 4, 7)}
NUMBERS = "amplitude_factor = [1.0, 1.2]"
STUDIES |= {
    "all": study(*ENDS),
    "none": study("error", "rejected", grid=MAP),
    "numbers": study("untrusted", "diverged", "exact", "error", grid=NUMBERS, keep="metrics"),
    "late": study("diverged").replace("off = 0.01", "part = 0.999"),
    "at-once": study("diverged", "ok").replace("off = 0.01", "part = 0.001"),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Folder with all studies and their results."""
    folder = tmp_path_factory.mktemp("drawn")
    for name, text in STUDIES.items():
        (folder / f"{name}.toml").write_text(text)
    members = json.dumps([str(folder / f"{name}.toml") for name in STUDIES])
    (folder / "collection.toml").write_text(f'title = "c"\nstudies = {members}\n')
    with pytest.MonkeyPatch.context() as patch:
        endings.register(patch)
        patch.setattr(theme, "FORMATS", ("png",))
        # Cells with the status error are told of.
        assert main(["run", str(folder / "collection.toml"), "--results", str(folder)]) == 1
        yield folder


def checked(figure):
    figure.draw_without_rendering()
    check_texts(figure)
    assert all(axis.lines or axis.collections for axis in figure.axes)
    return figure


def said(figure):
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return legends, [text.get_text() for axis in figure.axes for text in axis.texts]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", STUDIES)
def test_every_study_is_drawn(results, name):
    if name.startswith(("alone", "none")):
        checked(vm.plot(results / f"{name}.toml", results=results))
    if name.startswith("map"):
        # One output of two is enough.
        data = read_dataset(results / "studies" / f"{name}.nc", "source", "vehiclemor")
        panels = checked(vm.plot(data.sel(output=["spindle_y"]), "errors")).axes
        ticks = [tick.get_text() for tick in panels[0].get_yticklabels()]
        assert ticks == ["\N{MINUS SIGN}150", "0", "20"]
        assert sum(axis.get_label() != "<colorbar>" for axis in panels) == int(name[-1])
    else:
        checked(vm.plot(results / f"{name}.toml", "errors", results=results))


@pytest.mark.parametrize("name", ["all", "late", "at-once", "beside-exact", "beside-rejected"])
def test_a_run_is_drawn_to_its_end_and_only_a_diverged_one_has_diverged(results, name):
    data = read_dataset(results / "studies" / f"{name}.nc", "source", "vehiclemor")
    figure = vm.plot(str(results / f"{name}.toml"), results=results)
    legend, notes = said(checked(figure))
    assert ("has diverged" in legend) == (name in ("all", "late", "at-once"))
    assert "leaves the axes" not in legend
    assert notes == []
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    for label in data["label"].values:
        run = data.sel(label=label).squeeze()
        run = run.sel(frequency_factor=1.0) if "frequency_factor" in run.dims else run
        status = str(run["status"].item())
        mark = "*" if run["in_training"] else ""
        text = label.replace("_", " ") + mark + (f" ({status})" if status != "ok" else "")
        shown = lines[text].get_ydata()
        np.testing.assert_array_equal(shown, 1e3 * run["outputs"].sel(output="second_euler_angle"))
        assert np.isfinite(shown[-1]) == (status in ("ok", "untrusted"))


def test_what_has_no_values_says_so(results):
    legend, notes = said(vm.plot("alone-unreachable", results=results))
    assert legend == ["unreachable 0 (unreachable)"]
    assert notes == ["no finite values"] * 2


def test_a_figure_that_fails_is_named_and_stops_no_other(results, capsys, monkeypatch):
    names = ("numbers", "map-4", "alone-error")
    only = ["--only", ",".join(str(results / f"{name}.toml") for name in names)]
    arguments = ["figures", *only, "--results", str(results), "--out", str(results / "figures")]
    assert main([*arguments, "--dpi", "20"]) == 0
    written = {path.stem.removeprefix("figure-") for path in (results / "figures").iterdir()}
    kinds = {name: ("errors", "histories")[: 1 + (name != "numbers")] for name in names}
    assert written == {f"{name}-{kind}" for name, every in kinds.items() for kind in every}
    vm.write_report(str(results / "none.toml"), results / "page.html", results)
    assert "Left out" not in (results / "page.html").read_text(encoding="utf-8")
    capsys.readouterr()

    def broken(*_):
        raise IndexError("index 51 is out of bounds")

    monkeypatch.setitem(result_plot.DRAWINGS, "histories", broken)
    only = ["--only", f"{results / 'alone-ok.toml'},1", "--results", str(results)]
    assert main(["figures", *only, "--out", str(results / "some"), "--dpi", "20"]) == 1
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert line.startswith("figure alone-ok-histories can't be drawn: IndexError")
    assert [row.rpartition("-")[2] for row in printed.out.split()] == ["errors.png", "1.png"]
    page = vm.write_report([str(results / "alone-ok.toml")], results / "page.html", results)
    head, _, rest = page.read_text(encoding="utf-8").partition("<ol")
    assert "Left out: histories of alone-ok (IndexError: index 51" in head
    assert "RMS errors" in rest


def test_paths_of_runs_that_have_failed(results):
    data = read_dataset(results / "studies" / "all.nc", "source", "vehiclemor")
    data = data.sel(output=["spindle_x", "spindle_y"]).assign_coords(output=list(PATH))
    assert "diverged 2* (diverged)" in said(checked(vm.plot(data.squeeze(), "paths")))[0]


def test_what_was_not_compared_is_drawn_alone(tmp_path):
    rom = vm.reduce("double_wishbone", "pod", rank=3)
    for result in (rom.dataset(rom.simulate()), vm.simulate("double_wishbone", errors=False)):
        figure = vm.plot(result, out=tmp_path / "run.png")
        assert len(figure.axes) == 2
        legend, notes = said(figure)
        assert notes == []
        assert len(legend) == 1
        shown = 1e3 * result["outputs"].sel(output="second_euler_angle")
        np.testing.assert_array_equal(figure.axes[0].lines[-1].get_ydata(), shown)
        with pytest.raises(InputError, match="not compared with full order"):
            vm.plot(result, "errors")


def test_a_study_is_drawn_by_the_name_of_its_results(results, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["plot", "all", "--results", str(results)]) == 0
    assert (tmp_path / "all-histories.png").exists()
    # Another study of that name is stored beside it.
    other = tmp_path / "all.toml"
    other.write_text(study("ok", grid=CURVE))
    vm.run_study(other, results=results)
    shown = vm.plot(other, "errors", results=results).axes[0]
    assert shown.get_xlabel() == "frequency perturbation (%)"
    assert main(["plot", "al", "--results", str(results)]) == 2
    assert "unknown study 'al'" in capsys.readouterr().err


def test_a_map_of_two_amplitudes_has_its_published_line(results):
    values = ", ".join(f"{value:.3f}" for value in np.linspace(0.8, 1.2, 51))
    grid = f"frequency_factor = [{values}]\namplitude_factor = [1.0, 1.1]"
    (results / "wide.toml").write_text(
        study("ok", grid=grid, keep="metrics").replace("0.01", "1e-4")
    )
    checked(vm.plot(vm.run_study(results / "wide.toml", results=results), "errors"))


def test_counts_agree(results, capsys):
    path, name = str(results / "numbers.toml"), "numbers"
    assert main(["run", path, "--results", str(results)]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    data = read_dataset(results / "studies" / f"{name}.nc", "source", "vehiclemor")
    found = Counter(data["status"].values.ravel().tolist())
    doubted = int(data["remark"].str.contains("not to be trusted").sum())
    assert doubted
    counts = ", ".join(f"{found[end]} {end}" for end in sorted(found))
    told = counts.replace(" ok", f" ok ({doubted} not to be trusted)")
    assert f"{name}: 8 grid points, 8 cells: {told};" in printed
    assert main(["status", path, "--results", str(results)]) == 0
    assert f" {counts};" in " ".join(capsys.readouterr().out.split())
    page = vm.write_report([path], results / "page.html", results)
    assert f": {told}" in page.read_text(encoding="utf-8")

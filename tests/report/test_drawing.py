"""Any result is drawn: runs that end in every way, over any axes, of one to seven methods."""

import json
import shutil

import numpy as np
import pytest

import vehiclemor as vm
from tests.plugin.installation import registered
from tests.report.figure_texts import checked, varied
from vehiclemor.cli import main
from vehiclemor.exceptions import InputError
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.report.figures import result_plot, theme
from vehiclemor.report.figures.result_plot import plot_result

ENDS = ("ok", "untrusted", "diverged", "rejected", "unreachable", "error", "exact")
ENDINGS = "tests.report.endings:METHOD"
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
STUDIES = {f"alone-{end}": study(end) for end in ("diverged", "unreachable")}
STUDIES |= {f"beside-{end}": study(end, "ok", grid=CURVE) for end in ("untrusted", "rejected")}
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
def folder(tmp_path_factory):
    """Folder with all studies and their results."""
    folder = tmp_path_factory.mktemp("drawn")
    for name, text in STUDIES.items():
        (folder / f"{name}.toml").write_text(text)
    members = json.dumps([str(folder / f"{name}.toml") for name in STUDIES])
    (folder / "collection.toml").write_text(f'title = "c"\nstudies = {members}\n')
    with pytest.MonkeyPatch.context() as patch, registered("method", "endings", ENDINGS):
        patch.setattr(theme, "FORMATS", ("png",))
        # Cells with the status error are told of.
        assert main(["run", str(folder / "collection.toml"), "--results", str(folder)]) == 1
        yield folder


def stored(folder, name):
    return read_dataset(folder / "studies" / f"{name}.nc")


def said(figure):
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return legends, [text.get_text() for axis in figure.axes for text in axis.texts]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", STUDIES)
def test_every_study_is_drawn(folder, name):
    if name.startswith(("alone", "none")):
        checked(vm.plot(folder / f"{name}.toml", results=folder))
    checked(vm.plot(folder / f"{name}.toml", "errors", results=folder))


@pytest.mark.parametrize("name", ["all", "late", "at-once", "beside-untrusted", "beside-rejected"])
def test_a_run_is_drawn_to_its_end_and_only_a_diverged_one_has_diverged(folder, name):
    data = stored(folder, name)
    figure = vm.plot(str(folder / f"{name}.toml"), results=folder)
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


def test_a_run_far_from_full_order_is_cut_where_it_leaves(folder):
    data = stored(folder, "all").sel(label=["ok_0", "untrusted_1"]).squeeze()
    data["outputs"].loc[{"label": "untrusted_1"}] *= 10.0
    figure = checked(vm.plot(data))
    axis = figure.axes[0]
    assert "leaves the axes" in said(figure)[0]
    (line,) = (x for x in axis.lines if x.get_label().startswith("untrusted"))
    seen = line.get_ydata()[np.isfinite(line.get_ydata())]
    low, high = axis.get_ylim()
    assert 10 < seen.size < data.sizes["time"]
    assert not low <= seen[-1] <= high
    assert all(low <= value <= high for value in seen[:-1])
    full = 1e3 * data["reference_outputs"].sel(output="second_euler_angle")
    assert high - low < 3.0 * float(full.max() - full.min())


def test_a_figure_that_fails_is_named_and_stops_no_other(folder, capsys, monkeypatch):
    names = ("numbers", "map-4", "alone-diverged")
    only = ["--only", *(str(folder / f"{name}.toml") for name in names)]
    arguments = ["figures", *only, "--results", str(folder), "--out", str(folder / "figures")]
    assert main(arguments) == 0
    written = {path.stem.removeprefix("figure-") for path in (folder / "figures").iterdir()}
    kinds = {name: ("errors", "histories")[: 1 + (name != "numbers")] for name in names}
    assert written == {f"{name}-{kind}" for name, every in kinds.items() for kind in every}
    vm.write_report(str(folder / "none.toml"), folder / "page.html", folder)
    assert "Left out" not in (folder / "page.html").read_text(encoding="utf-8")
    capsys.readouterr()

    def broken(*_):
        raise IndexError("index 51 is out of bounds")

    histories = result_plot.PICTURES["histories"]._replace(draw=broken)
    monkeypatch.setitem(result_plot.PICTURES, "histories", histories)
    # A comma belongs to the name of a file.
    late = shutil.copy(folder / "late.toml", folder / "late, or not.toml")
    only = ["--only", str(late), "--only", str(folder / "numbers.toml"), "--results", str(folder)]
    assert main(["figures", *only, "--out", str(folder / "some")]) == 1
    printed = capsys.readouterr()
    *_, line = printed.err.splitlines()
    assert line.startswith("figure late, or not-histories can't be drawn: IndexError")
    assert [row.rpartition("-")[2] for row in printed.out.splitlines()] == ["errors.png"] * 2
    page = vm.write_report([str(folder / "late.toml")], folder / "page.html", folder)
    head, _, rest = page.read_text(encoding="utf-8").partition("<ol")
    assert "late (IndexError: index 51" in head
    assert "RMS errors" in rest


def test_what_was_not_compared_is_drawn_alone(tmp_path):
    rom = vm.reduce("double_wishbone", "pod", rank=3)
    alone = {"POD": rom.dataset(rom.simulate())}
    alone["full order"] = vm.simulate("double_wishbone", errors=False)
    for name, result in alone.items():
        figure = vm.plot(result, out=tmp_path / "run.png")
        assert len(figure.axes) == 3
        legend, notes = said(figure)
        assert notes == []
        assert legend == [name]
        (travel,) = figure.axes[2].lines
        np.testing.assert_array_equal(travel.get_ydata(), result["inputs"].sel(input="z"))
        shown = 1e3 * result["outputs"].sel(output="second_euler_angle")
        np.testing.assert_array_equal(figure.axes[0].lines[-1].get_ydata(), shown)
        with pytest.raises(InputError, match="not compared"):
            vm.plot(result, "errors")


def test_a_rank_study_has_ranks_across_says_where_they_end_and_names_its_point(tmp_path, capsys):
    study = STUDIES["none"].partition("[grid]")[0] + "[grid]\nrank = [3, 4, 8]\n"
    study += "frequency_factor = [1.0, 1.2]\n"
    study += "".join(f'[[methods]]\nmethod = "{name}"\n' for name in ("pod", "replay"))
    path = tmp_path / "ranks.toml"
    path.write_text(study)
    assert main(["compare", str(path), "--results", str(tmp_path)]) == 0
    assert "\npod saturates at rank 4\n" in capsys.readouterr().out
    figure = checked(vm.plot(path, "errors", results=tmp_path))
    assert [axis.get_xlabel() for axis in figure.axes] == ["rank; POD saturates at 4"] * 2
    assert "POD, frequency factor 1.2" in said(figure)[0]
    point = vm.plot(path, results=tmp_path).get_suptitle()
    assert point.endswith("at frequency_factor 1.0, rank 3")


@pytest.mark.parametrize(
    ("study", "drawn", "word"),
    [
        ("figure-13-frequency", {}, "no histories"),
        ("figure-11", {"kind": "paths"}, "no path"),
        ("figures-2-4", {"kind": "curve"}, "curve"),
        ("figures-2-4", {"kind": 3}, "kind"),
        ("figures-2-4", {"rank": 99}, "99"),
        ("figures-2-4", {"start": ["dropped"]}, "start"),
        ("figures-2-4", {"r": 3}, "'r'"),
    ],
)
def test_what_cannot_be_drawn_is_refused(results, study, drawn, word):
    with pytest.raises(InputError, match=word):
        vm.plot(results[study], **drawn)


FACTOR = {"frequency_factor": [0.8, 1.0, 1.2, 1.4]}
MANY = {"rank": [*range(1, 9)]}


@pytest.mark.parametrize(
    ("dimensions", "label"),
    [
        (FACTOR | {"rank": [1, 2, 3]}, "frequency perturbation (%)"),
        (FACTOR | {"amplitude_factor": [0.9, 1.0]}, "frequency perturbation (%)"),
        ({"tolerance": [1e-8, 1e-6, 1e-3]}, "tolerance"),
        (MANY | {"formulation": ["state", "paired"], "start": ["a", "b", "c"]}, "rank"),
        ({"formulation": ["coordinates", "state", "paired"]}, "formulation"),
        ({"equation_seed": [*range(30)]}, "equation seed"),
    ],
)
def test_figures_follow_from_what_varies(dimensions, label):
    figure = checked(plot_result(varied(**dimensions), None, "errors"))
    shown = figure.axes
    assert len(shown) == 2
    assert shown[-1].get_xlabel() == label
    assert (shown[-1].get_xscale() == "log") == (label == "tolerance")
    if label == "rank":
        ticks = shown[-1].get_xticks()
        assert all(float(tick).is_integer() for tick in ticks)


def test_curves_show_the_errors():
    dataset = varied(**FACTOR, rank=[2, 3])
    # One method does not depend on the rank.
    dataset["rms_error"][:, 1, 1] = dataset["rms_error"][:, 0, 1]
    axis = plot_result(dataset, None, "errors").axes[0]
    lines = {line.get_label(): line for line in axis.lines if np.size(line.get_xdata())}
    own = {"POD, rank 2", "POD, rank 3", "my own method"}
    assert set(lines) == own | {"published, nominal"}
    for rank in (2, 3):
        place = {"label": "pod", "rank": rank, "output": "second_euler_angle"}
        line = lines[f"POD, rank {rank}"]
        np.testing.assert_array_equal(line.get_ydata(), dataset["rms_error"].sel(place))
        np.testing.assert_allclose(line.get_xdata(), [-20.0, 0.0, 20.0, 40.0], atol=1e-12)
    dataset = varied(**MANY, formulation=["state", "paired"], start=["a", "b", "c"])
    figure = plot_result(dataset, None, "errors")
    assert "the largest error over start and formulation" in figure.get_suptitle()
    errors = dataset["rms_error"].max(["formulation", "start"]).sel(label="pod")
    (line,) = (x for x in figure.axes[0].lines if x.get_label() == "POD")
    np.testing.assert_array_equal(line.get_ydata(), errors.sel(output="second_euler_angle"))

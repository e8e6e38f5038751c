"""The paper's figures at their final size, its numbers by name, and the archive of results."""

import hashlib
import re
import zipfile

import archive
import measured_numbers
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from drawings import coverage
from drawings.catalogue import FIGURES
from mesh_sizes import size_rows
from numbers_by_name import load
from regenerate import PAPER, STYLE

import vehiclemor as vm
from tests.report.figure_texts import checked
from vehiclemor.cli import main
from vehiclemor.netcdf_file import read_dataset, write_dataset
from vehiclemor.report.figures.theme import styled

# Widths of a column and of both in inches.
WIDTHS = 8.6 / 2.54, 17.8 / 2.54


def datasets(entry, results):
    """Datasets of a figure, from the studies of the paper; None if one is not among them."""
    if not set(entry.studies) <= set(results):
        return None
    return {name: results[name] for name in entry.studies}


@pytest.fixture(scope="session")
def drawn(results):
    """Every figure of the paper that its studies and models give, drawn."""
    figures = {}
    for name, entry in FIGURES.items():
        data = datasets(entry, results)
        if data is not None:
            with styled(STYLE):
                figures[name] = entry.draw(*([data] if data else []), **entry.options)
    return figures


def test_figures_are_as_wide_as_a_column_or_two_and_nothing_is_cut_off(drawn):
    assert {f"figure-{number:02d}" for number in range(1, 15)} <= set(drawn)
    for name, figure in drawn.items():
        assert min(abs(figure.get_figwidth() - width) for width in WIDTHS) < 1e-9, name
        with styled(STYLE):
            checked(figure)


@pytest.fixture
def other_steering():
    """Runs of both vehicles: with steering, one of which has failed, and with brakes."""
    columns = {
        "kind": ["speeds", "speeds", "speeds", "pulses", "brakes", "brakes"],
        "speed": [18.0, 19.0, 32.5, 19.0, 20.0, 20.0],
        "acceleration": [4.4, 4.6, 1.5, 4.5, 3.0, 4.0],
        "sideways": [4.4, 4.6, 1.5, 4.5, 0.5, 2.0],
        "forward": [-0.1, -0.1, -0.1, -0.1, -4.0, 1.0],
        "score": [0.4, 3.0, np.inf, 50.0, np.nan, 0.5],
        "warned": [False, False, True, False, True, True],
    }
    tables = [pd.DataFrame({"model": name, **columns}) for name in coverage.VEHICLES]
    runs = pd.concat(tables, ignore_index=True).rename_axis("run").to_xarray()
    return {"other_steering": runs.assign_coords(name=["searched"])}


def test_coverage_shows_which_runs_keep_their_bounds_with_steering_and_with_brakes(other_steering):
    with styled(STYLE):
        figure = coverage.figure_coverage(other_steering)
        checked(figure)
    for number, axis in enumerate(figure.axes):
        marks = {line.get_label(): line.get_xydata().tolist() for line in axis.lines}
        right, needless, warned, undetected = (marks[text] for text in coverage.MARKS)
        if number < 2:
            assert (right, warned, undetected) == ([[18.0, 4.4]], [[32.5, 1.5]], [[19.0, 4.6]])
        else:
            assert (right, needless, warned) == ([], [[2.0, 1.0]], [[0.5, -4.0]])


def test_an_estimate_stands_over_its_error_and_what_it_tells_wrongly_is_marked(other_steering):
    runs = other_steering["other_steering"].isel(run=[1, 0, 0, 0, 0, 0] * 2)
    runs["model"] = "run", np.repeat(coverage.VEHICLES, 6)
    runs["estimate"] = 0.5 * runs["score"]
    with styled(STYLE):
        figure = coverage.figure_estimate({"other_steering": runs})
        checked(figure)
    for axis in figure.axes:
        rightly, warned, undetected, *_ = (line.get_xydata().tolist() for line in axis.lines)
        assert (rightly, warned, undetected) == ([], [], [[3.0, 1.5]])


def sized():
    """Times and errors of three meshes of shells, two of beams and a vehicle."""
    kinds = ["elements_per_bay"] * 2 + ["shell_size"] * 3 + ["vehicle"]
    meshes = [f"{kind} {place}" for place, kind in enumerate(kinds[:-1], 1)] + ["tricycle"]
    n = np.array([200.0, 400.0, 1000.0, 4000.0, 16000.0, 10.0])
    seconds = np.column_stack([1e-3 * n, np.full(6, 0.05)])
    errors = np.array([0.2, 0.2, 0.1, 0.02, 0.0, np.nan])
    errors = np.stack([errors, errors + 1e-3], axis=1)[..., None] * [1.0, 2.0]
    table = {
        "coordinates_of_mesh": ("mesh", n),
        "seconds_median": (("mesh", "label"), seconds),
        "effective_rank": (("mesh", "label"), np.full((6, 2), 40.0)),
        "offline_seconds": (("mesh", "label"), np.full((6, 2), 2.0)),
        "relative_error": (("mesh", "label", "group"), errors),
    }
    labels = {"mesh": meshes, "label": ["full order", "Craig-Bampton"]}
    labels |= {"group": ["motion", "strain"], "kind": ("mesh", kinds)}
    return xr.Dataset(table, labels)


def test_a_reduced_model_is_set_beside_the_cheapest_mesh_that_is_as_accurate():
    rows = {row["mesh"]: row for row in size_rows(sized())}
    assert rows["shells, 4 m"]["gain_mesh"] == pytest.approx(80.0)
    # A coarser mesh is as accurate: refining has gained nothing.
    assert rows["beams, 2 a bay"]["rival_motion"] == "beams, 1 a bay"
    assert rows["beams, 2 a bay"]["gain_motion"] == pytest.approx(4.0)
    assert rows["shells, 5 m"]["rival_strain"] == "shells, 5 m"
    assert rows["shells, 5 m"]["growth_full"] == pytest.approx(1.0)
    assert rows["shells, 5 m"]["break_even"] == pytest.approx(2.0 / (16.0 - 0.05))
    assert rows["tricycle"]["rival_motion"] == ""


def test_every_picture_of_the_text_is_there():
    text = (PAPER / "paper.typ").read_text(encoding="utf-8")
    pictures = set(re.findall(r'#picture\("([^"]+)"', text))
    assert pictures == set(FIGURES)
    for name in pictures:
        picture = PAPER / "figures" / f"{name}.svg"
        assert picture.stat().st_size <= 200_000, name
        # Glyphs are paths.
        assert "<text" not in picture.read_text(encoding="utf-8"), name


# Rounding chooses some of the modes there: another processor gives other numbers.
ROUNDED = ("figure-14-spread", "pod_literal_r6", "pod_literal_r4", "suspension_vehicle.pod_literal")


def test_studies_run_afresh_give_the_numbers(results):
    known, compared = load(), 0
    for study, make in measured_numbers.studies():
        if study not in results or study in ROUNDED:
            continue
        for name, value, *_ in make(results[study]):
            # Tolerance of ARTIFACT.md: processors round differently, and step sizes follow.
            if name in known and not any(part in name for part in ROUNDED):
                # An eigenvalue of zero is one up to rounding.
                nothing = 1e-3 if name.endswith("growth_rate") else 1e-9
                expected = pytest.approx(known[name]["value"], rel=1e-2, abs=nothing)
                assert float(value) == expected, name
                compared += 1
    assert compared > 20, compared


def test_an_archive_is_the_results_folder_again(tmp_path, capsys):
    results, out, unpacked = tmp_path / "results", tmp_path / "a.zip", tmp_path / "unpacked"
    (results / "studies").mkdir(parents=True)
    stored = vm.simulate("double_wishbone", "pod").expand_dims(label=["pod"])
    write_dataset(stored, results / "studies" / "mine.nc")
    (results / "peers.json").write_text("{}")
    archive.main(results, out)
    with zipfile.ZipFile(out) as file:
        file.extractall(unpacked)
    again = read_dataset(unpacked / "studies" / "mine.nc")
    assert again.identical(read_dataset(results / "studies" / "mine.nc"))
    sums = dict(
        line.split()[::-1] for line in (unpacked / "SHA256SUMS.txt").read_text().splitlines()
    )
    assert {"studies/mine.nc", "tables/mine.csv", "peers.json", "README.txt"} <= sums.keys()
    for name, digest in sums.items():
        assert hashlib.sha256((unpacked / name).read_bytes()).hexdigest() == digest
    table = pd.read_csv(unpacked / "tables" / "mine.csv", float_precision="round_trip")
    assert table["rms_error.toe"].item() == float(stored["rms_error"].sel(output="toe").item())
    picture = tmp_path / "mine.png"
    assert main(["plot", "mine", "--results", str(unpacked), "--out", str(picture)]) == 0
    assert picture.exists()
    assert f"{len(sums) + 1} files" in capsys.readouterr().out

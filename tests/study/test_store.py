"""What is stored comes back as it was, or is set aside, named and computed again."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vehiclemor.errors import SpoiledError
from vehiclemor.study import cell_file, workers
from vehiclemor.study.netcdf_file import read_dataset, write_dataset
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import ASIDE, read_arrays, read_cell, write_cell

GRID = """
title = "for the tests"
model = "double_wishbone"
keep = "metrics"

[grid]
rank = [2, 3]

[[methods]]
method = "pod"
"""
TIMED = ["seconds", "offline_seconds"]
KEY = "0123456789abcdef0123"


def a_cell() -> xr.Dataset:
    variables = {
        "error": (("output", "time"), np.arange(6.0).reshape(2, 3), {"units": "m"}),
        "status": ((), "ok", {}),
        "message": ((), "", {}),
    }
    return xr.Dataset(variables, {"output": ["pitch", "yaw"]}, {"title": "für die Tests"})


# The file of a cell

NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=8)
KINDS = [np.dtype(kind) for kind in ("f8", "f4", "i8", "i4", "u1", "?", "U5", "O")]
NUMBERS = st.floats() | st.integers(-(2**53), 2**53) | st.booleans()
ATTRIBUTES = st.dictionaries(
    NAMES, NAMES | NUMBERS | st.floats().map(np.float64) | st.lists(st.floats(allow_nan=False))
)


@st.composite
def datasets(draw) -> xr.Dataset:
    """Any dataset of numbers, truths and text on a few dimensions, some of it as coordinates."""
    sizes = draw(st.dictionaries(NAMES, st.integers(0, 3), max_size=3))
    found: dict[str, tuple] = {}
    for name in draw(st.lists(NAMES, max_size=4, unique=True)):
        dimensions = draw(st.permutations(list(sizes)))[: draw(st.integers(0, len(sizes)))]
        dimensions = [name] if name in sizes else dimensions
        kind = draw(st.sampled_from(KINDS))
        shape = tuple(sizes[d] for d in dimensions)
        texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5)
        values = draw(arrays.arrays(kind, shape, elements=texts if kind.kind in "OU" else None))
        found[name] = dimensions, values, draw(ATTRIBUTES)
    dataset = xr.Dataset(found, attrs=draw(ATTRIBUTES))
    chosen = [name for name in dataset.data_vars if draw(st.booleans())]
    return dataset.set_coords(chosen)


@settings(max_examples=60, deadline=None)
@given(datasets(), st.floats(0.0, 1e6))
def test_any_dataset_comes_back_as_it_was(dataset, seconds):
    content = cell_file.encoded(dataset, KEY, seconds)
    again = cell_file.dataset_of(content, KEY)
    xr.testing.assert_identical(dataset, again)
    assert list(dataset.variables) == list(again.variables)
    found = cell_file.arrays_of(content, KEY)
    for name, variable in dataset.variables.items():
        assert variable.dtype == again[name].dtype
        assert again[name].values.flags.writeable or name in again.indexes
        if variable.dtype.kind in "OU":
            assert np.asarray(found[name], dtype=object).tolist() == variable.values.tolist()
        else:
            assert found[name].dtype == variable.dtype
            assert found[name].tobytes() == variable.values.tobytes()


def test_what_has_no_place_in_a_cell_is_refused():
    with pytest.raises(TypeError, match="objects that are no text"):
        cell_file.encoded(xr.Dataset({"x": ("d", np.array([{}], dtype=object))}), KEY)
    with pytest.raises(Exception, match="datetime64"):
        cell_file.encoded(xr.Dataset({"x": ("d", np.array(["2026"], dtype="M8[Y]"))}), KEY)
    with pytest.raises(TypeError, match="Path can't be stored"):
        cell_file.encoded(xr.Dataset(attrs={"file": Path()}), KEY)


def test_other_tools_read_the_arrays_and_who_wrote_them(tmp_path):
    from safetensors import safe_open

    write_cell(a_cell(), tmp_path, KEY)
    (path,) = (tmp_path / "cells").rglob("*.safetensors")
    with safe_open(path, "np") as file:
        assert file.metadata()["schema"] == cell_file.SCHEMA
        np.testing.assert_array_equal(file.get_tensor("error"), a_cell()["error"])


def test_every_flipped_bit_and_every_part_of_a_file_is_noticed():
    whole = cell_file.encoded(a_cell(), KEY, 0.5)
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << place % 8
        with pytest.raises(SpoiledError):
            cell_file.dataset_of(bytes(flipped), KEY)
        with pytest.raises(SpoiledError):
            cell_file.arrays_of(whole[:place], KEY)
    with pytest.raises(SpoiledError):
        cell_file.check(whole + b"\0", KEY)


def test_foreign_results_and_those_of_other_versions_are_named(monkeypatch):
    with pytest.raises(SpoiledError, match="not the result that belongs here, but of 0123"):
        cell_file.check(cell_file.encoded(a_cell(), KEY), KEY[::-1])
    monkeypatch.setattr(cell_file, "SCHEMA", "vehiclemor cell 0")
    old = cell_file.encoded(a_cell(), KEY)
    monkeypatch.undo()
    with pytest.raises(SpoiledError, match="'vehiclemor cell 0', where this version writes"):
        cell_file.check(old, KEY)


def test_how_a_cell_has_ended_is_told_by_its_header(tmp_path):
    many = a_cell().drop_vars(["status", "message"])
    many = many.assign(
        status=("run", ["ok", "diverged", "ok"]), message=("run", ["", "at 1 s", ""])
    )
    many.attrs["long"] = "x" * cell_file.FIRST
    for dataset in (a_cell(), many):
        path = tmp_path / "cell"
        path.write_bytes(cell_file.encoded(dataset, KEY, 0.25)[:-8])
        end = cell_file.end_of(path, KEY)
        assert end.seconds == 0.25
    assert end.runs == {("ok", ""): 2, ("diverged", "at 1 s"): 1}


# Studies on a folder with damage


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Path:
    """A study file and the folder `out` with its results; not to be changed."""
    folder = tmp_path_factory.mktemp("done")
    (folder / "small.toml").write_text(GRID)
    run_studies(str(folder / "small.toml"), folder / "out")
    return folder


@pytest.fixture
def place(done, tmp_path) -> Path:
    """A copy of it, with the times of the files."""
    return shutil.copytree(done, tmp_path / "place")


@pytest.fixture
def computed(monkeypatch) -> list[str]:
    """Keys of experiments that are computed."""
    keys: list[str] = []
    evaluate = workers.evaluate

    def counted(experiment):
        keys.append(experiment.key)
        return evaluate(experiment)

    monkeypatch.setattr(workers, "evaluate", counted)
    return keys


def run(study: Path, out: Path) -> xr.Dataset:
    return next(iter(run_studies(str(study), out).values())).drop_vars(TIMED)


def cells(place: Path) -> list[Path]:
    return sorted((place / "out" / "cells").glob("[!.s]?/*"))


def other_version(content: bytes) -> bytes:
    return content.replace(b"vehiclemor cell 1", b"vehiclemor cell 7", 1)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda whole, _: whole[:-9], "what it holds is not what was written"),
        (lambda whole, _: whole[:200], "truncated, or no result of this package"),
        (lambda *_: b"", "truncated, or no result of this package"),
        (lambda *_: b"my notes", "truncated, or no result of this package"),
        (lambda _, other: other, "not the result that belongs here, but of"),
        (lambda whole, _: other_version(whole), "'vehiclemor cell 7', where this version writes"),
    ],
    ids=["cut", "header", "empty", "text", "foreign", "version"],
)
def test_a_spoiled_cell_is_set_aside_and_computed_again(
    done, place, computed, caplog, change, reason
):
    first, second = cells(place)
    spoiled = change(first.read_bytes(), second.read_bytes())
    first.write_bytes(spoiled)
    (place / "out" / "studies" / "small.nc").unlink()
    xr.testing.assert_identical(run(place / "small.toml", place / "out"), reread(done))
    aside = place / "out" / "cells" / ASIDE / first.name
    assert aside.read_bytes() == spoiled
    assert computed == [first.stem]
    (line,) = caplog.messages
    assert line.startswith(f"{first}: {reason}")
    assert line.endswith(f"; moved to {aside}, and computed again")


def reread(place: Path) -> xr.Dataset:
    return read_dataset(place / "out" / "studies" / "small.nc", "source", "vehiclemor").drop_vars(
        TIMED
    )


def test_a_folder_in_the_place_of_a_cell_is_set_aside(place, computed, caplog):
    (first, _) = cells(place)
    for number in ("", "-2"):
        first.unlink()
        first.mkdir()
        (place / "out" / "studies" / "small.nc").unlink()
        run(place / "small.toml", place / "out")
        name = f"{first.stem}{number}{first.suffix}"
        assert (place / "out" / "cells" / ASIDE / name).is_dir()
        assert first.is_file()
    assert len(computed) == len(caplog.messages) == 2


def test_many_spoiled_cells_are_a_few_lines(tmp_path, caplog):
    study = tmp_path / "many.toml"
    study.write_text(GRID.replace("[2, 3]", "{ first = 1, last = 8, count = 8 }"))
    study.write_text(study.read_text().replace("rank =", "frequency_factor ="))
    run(study, tmp_path)
    for path in (tmp_path / "cells").glob("??/*"):
        path.write_bytes(b"")
    (tmp_path / "studies" / "many.nc").unlink()
    assert (run(study, tmp_path)["status"] == "ok").all()
    assert len(list((tmp_path / "cells" / ASIDE).iterdir())) == 8
    assert len(caplog.messages) == 6
    assert caplog.messages[-1] == f"{tmp_path / 'cells' / ASIDE}: 8 such cells in all"


def test_a_cell_that_was_spoiled_since_is_not_read(place):
    (first, _) = cells(place)
    first.write_bytes(first.read_bytes()[:-1])
    for read in (read_cell, read_arrays):
        with pytest.raises(SpoiledError, match=rf"{first}: .*; run again"):
            read(place / "out", first.stem)


@pytest.mark.parametrize(
    "damage", [lambda whole: whole[: len(whole) // 2], lambda _: b"my notes"], ids=["cut", "text"]
)
def test_a_spoiled_combined_dataset_is_set_aside_and_made_again(
    done, place, computed, caplog, damage
):
    path = place / "out" / "studies" / "small.nc"
    path.write_bytes(spoiled := damage(path.read_bytes()))
    xr.testing.assert_identical(run(place / "small.toml", place / "out"), reread(done))
    assert (path.parent / ASIDE / "small.nc").read_bytes() == spoiled
    assert computed == []
    assert f"{path}: not a readable result file" in caplog.messages[0]
    xr.testing.assert_identical(reread(place), reread(done))


def test_cells_of_an_older_version_are_left_alone(tmp_path, caplog, computed):
    caplog.set_level("INFO", "vehiclemor")
    (tmp_path / "small.toml").write_text(GRID)
    (old := tmp_path / "cells" / f"{KEY}.nc").parent.mkdir()
    old.write_bytes(b"netCDF")
    run(tmp_path / "small.toml", tmp_path)
    assert old.read_bytes() == b"netCDF"
    assert len(computed) == 2
    told = [line for line in caplog.messages if "older version" in line]
    line = "1 cells of an older version (*.nc) are left alone; what is missing is computed"
    assert told == [f"{tmp_path / 'cells'}: {line}"]


# Whose results these are


def test_two_studies_of_one_name_are_both_stored(place, computed):
    other = place / "other" / "small.toml"
    other.parent.mkdir()
    other.write_text(GRID.replace("[2, 3]", "[3, 4]"))
    out = place / "out"
    both = [run(path, out) for path in (other, place / "small.toml", other)]
    # The cell that both have is computed once.
    assert len(computed) == 1
    assert [list(dataset["rank"].values) for dataset in both] == [[3, 4], [2, 3], [3, 4]]
    names = sorted(path.name for path in (out / "studies").iterdir())
    assert names == [f"small-{both[0].attrs['content']}.nc", "small.nc"]
    # A study that was edited in its place is the same study.
    (place / "small.toml").write_text(GRID.replace("[2, 3]", "[2, 3, 4]"))
    assert run(place / "small.toml", out).sizes["rank"] == 3
    assert len(computed) == 1
    assert sorted(path.name for path in (out / "studies").iterdir()) == names


def test_a_collection_may_have_two_studies_of_one_name(place, computed):
    paths = [place / name / "small.toml" for name in ("a", "b")]
    for path, ranks in zip(paths, ("[2, 3]", "[3]"), strict=True):
        path.parent.mkdir()
        path.write_text(GRID.replace("[2, 3]", ranks))
    both = place / "both.toml"
    both.write_text(f'title = "both"\nstudies = {json.dumps([str(path) for path in paths])}\n')
    results = run_studies(str(both), place / "out")
    assert [dataset.sizes["rank"] for dataset in results.values()] == [2, 1]
    assert computed == []


def test_a_study_that_was_renamed_is_the_same(place, computed, monkeypatch):
    path = (place / "small.toml").rename(place / "renamed.toml")
    before = reread(place)
    monkeypatch.setattr("vehiclemor.study.run.combined", None)
    after = run_studies(str(path), place / "out")["renamed"]
    xr.testing.assert_equal(after.drop_vars(TIMED), before)
    assert after.attrs["study"] == "renamed"
    names = sorted(p.name for p in (place / "out" / "studies").iterdir())
    assert names == ["renamed.nc", "small.nc"]
    assert computed == []


def test_a_foreign_dataset_of_the_name_of_a_study_is_set_aside(place):
    path = place / "out" / "studies" / "small.nc"
    write_dataset(xr.Dataset(attrs={"title": "mine"}), path)
    run(place / "small.toml", place / "out")
    aside = path.parent / ASIDE / "small.nc"
    assert read_dataset(aside, "title", "mine").attrs == {"title": "mine"}

"""What is stored comes back as it was, or is set aside, named and computed again."""

import json
import logging
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from tests.study.small import TIMED, small_study
from vehiclemor import netcdf_file
from vehiclemor.errors import InputError, SpoiledError
from vehiclemor.netcdf_file import read_dataset, write_dataset
from vehiclemor.report.result_selection import stored_result
from vehiclemor.study import cell_file, workers
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import ASIDE, read_cell, write_cell

GRID = 'keep = "metrics"\ngrid = { rank = [2, 3] }\n'
KEY = "0123456789abcdef0123"


def a_cell() -> xr.Dataset:
    variables = {
        "error": (("output", "time"), np.arange(6.0).reshape(2, 3), {"units": "m"}),
        "status": ((), "ok", {}),
        "message": ((), "", {}),
    }
    return xr.Dataset(variables, {"output": ["pitch", "yaw"]}, {"title": "für die Tests"})


# The file of a cell

KINDS = [np.dtype(kind) for kind in ("f8", "f4", "i8", "i4", "u1", "?", "U5", "O")]


@pytest.mark.parametrize("shape", [{}, {"none": 0}, {"Länge": 2, "time": 3}], ids=str)
def test_any_dataset_comes_back_as_it_was(shape):
    values = np.arange(np.prod([*shape.values()], dtype=int)).reshape(tuple(shape.values()))
    arrays = {kind.str: values.astype("U5").astype(kind) for kind in KINDS}
    arrays["<f8"] = np.where(values > 1, np.nan, -np.inf * (1 + values))
    attributes = {"units": "m/s²", "nan": float("nan"), "none": [], "many": [1.5, 2], "yes": True}
    found = {name: (list(shape), array, attributes) for name, array in arrays.items()}
    dataset = xr.Dataset(found, attrs=attributes).set_coords(["<f4", "|O"])
    dataset = dataset.assign_coords({name: np.arange(size) for name, size in shape.items()})
    content = cell_file.encoded(dataset, KEY, 0.5)
    cell = cell_file.decoded(content, KEY)
    again, held = cell.dataset(), {name: array for name, (_, array, _) in cell.variables.items()}
    xr.testing.assert_identical(dataset, again)
    assert list(dataset.variables) == list(again.variables)
    for name, variable in dataset.variables.items():
        assert again[name].values.flags.writeable or name in again.indexes
        if variable.dtype.kind in "OU":
            assert held[name].tolist() == variable.values.tolist()
        else:
            assert variable.dtype == again[name].dtype
            assert held[name].tobytes() == variable.values.tobytes()


def test_what_has_no_place_in_a_cell_is_refused():
    with pytest.raises(TypeError, match="expected str"):
        cell_file.encoded(xr.Dataset({"x": ("d", np.array([{}], dtype=object))}), KEY)
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
        for damaged in (bytes(flipped), whole[:place], whole + bytes(place + 1)):
            with pytest.raises(SpoiledError):
                cell_file.decoded(damaged, KEY)


def test_what_is_no_json_of_ours_is_spoiled():
    deep = "[" * 200_000
    header = b'{"__metadata__":{"schema":"%s","key":[3]}}' % cell_file.SCHEMA.encode()
    for head in (deep.encode(), b"3", b"{}", header):
        with pytest.raises(SpoiledError):
            cell_file.decoded(len(head).to_bytes(8, "little") + head, KEY)


def test_how_a_cell_has_ended(tmp_path):
    many = a_cell().drop_vars(["status", "message"])
    ends = {"status": ["ok", "diverged", "ok"], "message": ["", "at 1 s", ""]}
    many = many.assign({name: ("run", texts) for name, texts in ends.items()})
    write_cell(many, tmp_path, KEY, 0.25)
    cell = read_cell(tmp_path, KEY)
    assert (cell.seconds, cell.broken) == (0.25, False)
    assert cell.ends == {("ok", ""): 2, ("diverged", "at 1 s"): 1}


# Studies on a folder with damage


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Path:
    """A study file and the folder `out` with its results; not to be changed."""
    folder = tmp_path_factory.mktemp("done")
    run_studies(str(small_study(folder, GRID, "pod")), folder / "out")
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


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda whole, _: whole[:-9], "not what was written"),
        (lambda whole, _: whole[:200], "truncated"),
        (lambda *_: b"", "truncated"),
        (lambda _, other: other, "not the result that belongs here"),
        (lambda whole, _: whole.replace(b"cell 3", b"cell 7", 1), "'vehiclemor cell 7'"),
    ],
    ids=["cut", "header", "empty", "foreign", "version"],
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
    for words in (first, aside, reason):
        assert str(words) in line


def reread(place: Path) -> xr.Dataset:
    return read_dataset(place / "out" / "studies" / "small.nc", "source", "vehiclemor").drop_vars(
        TIMED
    )


def test_a_cell_that_is_missing_is_computed_again(done, place, computed):
    (first, _) = cells(place)
    first.unlink()
    xr.testing.assert_identical(run(place / "small.toml", place / "out"), reread(done))
    assert computed == [first.stem]


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


def test_a_combined_dataset_with_any_damage_is_made_again(done, place, computed, caplog):
    path, study = place / "out" / "studies" / "small.nc", place / "small.toml"
    whole, rng = path.read_bytes(), np.random.default_rng(2)
    damaged = [whole[:-1], whole[:-1000], whole + b"x"]
    for at in range(0, len(whole), 11999):
        bit, flipped = int(rng.integers(8 * len(whole))), bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged += [bytes(flipped), whole[:at] + b"damage" + whole[at + 6 :]]
    for number, content in enumerate(damaged, start=1):
        path.write_bytes(content)
        with pytest.raises(SpoiledError) as error:
            read_dataset(path, "source", "vehiclemor")
        assert "\n" not in str(error.value)
        xr.testing.assert_identical(run(study, place / "out"), reread(done))
        xr.testing.assert_identical(reread(place), reread(done))
        aside = sorted((path.parent / ASIDE).iterdir())
        assert len(aside) == len(caplog.messages) == number
        assert content in [file.read_bytes() for file in aside]
    assert computed == []


def test_a_file_of_others_is_read_if_the_library_can(tmp_path, monkeypatch):
    dataset, path = a_cell().assign_attrs(source="vehiclemor"), tmp_path / "a.nc"
    dataset.to_netcdf(path)
    xr.testing.assert_identical(read_dataset(path, "source", "vehiclemor"), dataset)
    monkeypatch.setattr(netcdf_file, "LIMIT", 1.0)
    for code, reason in (
        ("while True: pass", "reading it does not end in 1 s"),
        ("import os; os.abort()", "damaged, or no netCDF-4 file"),
    ):
        monkeypatch.setattr(netcdf_file, "READ", code)
        with pytest.raises(SpoiledError, match=rf"{path}: not a readable result file .*{reason}"):
            read_dataset(path, "source", "vehiclemor")


def test_other_tools_read_files_that_end_with_their_hash(tmp_path):
    dataset, path = a_cell().assign_attrs(source="vehiclemor"), tmp_path / "a.nc"
    write_dataset(dataset, path)
    with xr.open_dataset(path) as read:
        xr.testing.assert_identical(read, dataset)
    renamed = path.rename(tmp_path / "b.nc")
    xr.testing.assert_identical(read_dataset(renamed, "source", "vehiclemor"), dataset)
    # The netCDF library drops the hash; what it writes is not ours.
    with netCDF4.Dataset(renamed, "a") as file:
        file.title = "another"
    with pytest.raises(SpoiledError, match="not what was written"):
        read_dataset(renamed, "source", "vehiclemor")


# Whose results these are


def test_of_two_studies_of_one_name_the_last_is_stored_and_told(place, computed, caplog):
    other = small_study(place / "other", GRID.replace("[2, 3]", "[3, 4]"), "pod")
    out, path = place / "out", place / "out" / "studies" / "small.nc"
    caplog.set_level(logging.INFO, "vehiclemor")
    for study, ranks in ((other, [3, 4]), (place / "small.toml", [2, 3]), (other, [3, 4])):
        told = len(caplog.messages)
        # What stands there is of the other.
        with pytest.raises(InputError, match="no such result"):
            stored_result(str(study), out)
        for _ in range(2):
            assert list(run(study, out)["rank"].values) == ranks
        assert list(stored_result(str(study), out)["rank"].values) == ranks
        assert [str(path) in message for message in caplog.messages[told:]] == [True]
    # The cell that both have is computed once.
    assert len(computed) == 1
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_collection_may_have_two_studies_of_one_name(place, computed):
    grids = {"a": GRID, "b": GRID.replace("[2, 3]", "[3]")}
    paths = [small_study(place / name, grid, "pod") for name, grid in grids.items()]
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

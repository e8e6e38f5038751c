"""What is stored comes back as it was, or is quarantined, named and computed again."""

import hashlib
import json
import logging
import os
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from tests.study.small import TIMED, small_study
from vehiclemor import netcdf_file
from vehiclemor.exceptions import CorruptError, InputError
from vehiclemor.netcdf_file import read_dataset, write_dataset
from vehiclemor.report.results import stored_result
from vehiclemor.study import store, workers
from vehiclemor.study.run import run_studies
from vehiclemor.study.store import QUARANTINE, decoded, encoded

GRID = 'keep = "metrics"\ngrid = { rank = [2, 3] }\n'
KEY = "0123456789abcdef0123"


def a_run():
    variables = {
        "error": (("output", "time"), np.arange(6.0).reshape(2, 3), {"units": "m"}),
        "status": ("run", ["ok", "diverged", "ok"], {}),
        "message": ("run", ["", "at 1 s", ""], {}),
    }
    return xr.Dataset(variables, {"output": ["pitch", "yaw"]}, {"source": "vehiclemor"})


@pytest.mark.parametrize("shape", [{}, {"none": 0}, {"Länge": 2, "time": 3}], ids=str)
def test_any_dataset_comes_back_as_it_was(shape):
    values = np.arange(np.prod([*shape.values()], dtype=int)).reshape(tuple(shape.values()))
    kinds = [np.dtype(kind) for kind in ("f8", "f4", "i8", "i4", "u1", "?", "U5", "O")]
    arrays = {f"a{kind.num}": values.astype("U5").astype(kind) for kind in kinds}
    arrays["a12"] = np.where(values > 1, np.nan, -np.inf * (1 + values))
    arrays |= dict.fromkeys(("status", "message"), arrays["a17"])
    attributes = {"units": "m/s²", "long_name": "", "clock": "\x1b"}
    found = {name: (list(shape), array, attributes) for name, array in arrays.items()}
    dataset = xr.Dataset(found, attrs=attributes).set_coords(["a11", "a17"])
    dataset = dataset.assign_coords({name: np.arange(size) for name, size in shape.items()})
    again = decoded(encoded(dataset, KEY), KEY).dataset()
    xr.testing.assert_identical(dataset, again)
    assert list(dataset.variables) == list(again.variables)
    for name, variable in dataset.variables.items():
        if variable.dtype.kind not in "OU":
            assert variable.dtype == again[name].dtype
            assert again[name].values.tobytes() == variable.values.tobytes()


def test_what_has_no_place_in_a_run_is_refused():
    for wrong in ({"data_vars": {"x": ("d", np.array([{}], dtype=object))}}, {"attrs": {"a": {1}}}):
        with pytest.raises(TypeError):
            encoded(xr.Dataset(**wrong), KEY)


def test_every_flipped_bit_and_every_part_of_a_file_is_noticed():
    whole = encoded(a_run(), KEY)
    assert decoded(whole, KEY).ends == {("ok", ""): 2, ("diverged", "at 1 s"): 1}
    damaged = [b"3", b"{}", b"[" * 200_000, b'{"__metadata__":{"schema":[3]}}']
    damaged = [len(head).to_bytes(8, "little") + head for head in damaged]
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << place % 8
        damaged += [bytes(flipped), whole[:place], whole + bytes(place + 1)]
    for content in damaged:
        with pytest.raises(CorruptError):
            decoded(content, KEY)


SPECIAL = Path.mkdir, os.mkfifo, lambda path: path.symlink_to("/dev/zero")


def with_described(whole, change):
    """The content of a file with something else said of it, and the hash of that."""
    size = int.from_bytes(whole[:8], "little")
    header, arrays = json.loads(whole[8 : 8 + size]), whole[8 + size :]
    described = json.loads(header["__metadata__"]["dataset"])
    change(described["variables"], described)
    header["__metadata__"] |= {"dataset": json.dumps(described), "sha256": store.ZEROS}
    head = json.dumps(header, separators=(",", ":")).encode()
    changed = len(head).to_bytes(8, "little") + head + arrays
    digest = hashlib.sha256(changed).hexdigest().encode()
    return changed.replace(store.ZEROS.encode(), digest, 1)


@pytest.mark.parametrize(
    "change",
    [
        lambda variables, _: variables["error"].update(dimensions=["run", "time"]),
        lambda variables, _: variables["error"].update(attributes={"_FillValue": "0"}),
        lambda variables, _: variables["message"].update(text=[["a"], "b", "c"]),
        lambda variables, _: variables.update({"a/b": variables["message"]}),
        lambda variables, _: variables.pop("message"),
        lambda _, described: described.update(coordinates=["yaw"]),
    ],
)
def test_a_run_that_is_none_counts_as_damaged_whatever_its_hash(change):
    whole = encoded(a_run(), KEY)
    assert decoded(with_described(whole, lambda *_: None), KEY).ends
    with pytest.raises(CorruptError):
        decoded(with_described(whole, change), KEY)


# Studies on a folder with damage


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A study file and the folder `out` with its results; not to be changed."""
    folder = tmp_path_factory.mktemp("done")
    run_studies(str(small_study(folder, GRID, "pod")), folder / "out")
    return folder


@pytest.fixture
def place(done, tmp_path):
    """A copy of it, with the times of the files."""
    return shutil.copytree(done, tmp_path / "place")


@pytest.fixture
def computed(monkeypatch):
    """Keys of experiments that are computed."""
    keys, evaluate = [], workers.evaluate
    monkeypatch.setattr(workers, "evaluate", lambda e: keys.append(e.key) or evaluate(e))
    return keys


def run(study, out):
    return next(iter(run_studies(str(study), out).values())).drop_vars(TIMED)


def reread(place):
    path = place / "out" / "studies" / "small.nc"
    return read_dataset(path).drop_vars(TIMED)


@pytest.mark.parametrize(
    "change",
    [
        lambda whole, _: whole[:-9],
        lambda *_: b"",
        lambda _, other: other,
        lambda whole, _: whole.replace(store.SCHEMA.encode(), store.SCHEMA[::-1].encode(), 1),
        *(lambda *_, special=special: special for special in SPECIAL),
    ],
    ids=["cut", "empty", "foreign", "version", "folder", "pipe", "device"],
)
def test_a_corrupt_run_is_quarantined_and_computed_again(done, place, computed, caplog, change):
    first, second = sorted((place / "out" / "cells").glob("??/*"))
    quarantined = place / "out" / "cells" / QUARANTINE
    for name in (first.name, f"{first.stem}-2{first.suffix}"):
        made = change(first.read_bytes(), second.read_bytes())
        first.unlink()
        made(first) if callable(made) else first.write_bytes(made)
        number = first.lstat().st_ino
        (place / "out" / "studies" / "small.nc").unlink()
        xr.testing.assert_identical(run(place / "small.toml", place / "out"), reread(done))
        aside = quarantined / name
        assert aside.lstat().st_ino == number
        assert all(str(path) in caplog.messages[-1] for path in (first, aside))
    assert computed == [first.stem] * 2
    assert len(caplog.messages) == 2


def test_runs_that_do_not_fit_together_are_named(place):
    path = max((place / "out" / "cells").glob("??/*"))
    (place / "out" / "studies" / "small.nc").unlink()
    path.write_bytes(
        with_described(path.read_bytes(), lambda variables, _: variables.pop("warned"))
    )
    with pytest.raises(CorruptError, match="move it away"):
        run(place / "small.toml", place / "out")


def test_a_combined_dataset_with_any_damage_is_made_again(done, place, computed, caplog):
    path, study = place / "out" / "studies" / "small.nc", place / "small.toml"
    whole, rng = path.read_bytes(), np.random.default_rng(2)
    damaged = [whole[:-1], whole[:-1000], whole + b"x"]
    for at in range(0, len(whole), 23999):
        bit, flipped = int(rng.integers(8 * len(whole))), bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged += [bytes(flipped), whole[:at] + b"damage" + whole[at + 6 :]]
    for number, content in enumerate(damaged, start=1):
        path.write_bytes(content)
        with pytest.raises(CorruptError):
            read_dataset(path)
        xr.testing.assert_identical(run(study, place / "out"), reread(done))
        xr.testing.assert_identical(reread(place), reread(done))
        aside = sorted((path.parent / QUARANTINE).iterdir())
        assert len(aside) == len(caplog.messages) == number
        assert content in [file.read_bytes() for file in aside]
    # Nor is a file of others that stands in its place lost.
    write_dataset(xr.Dataset(attrs={"title": "mine"}), path)
    run(study, place / "out")
    found = sorted((path.parent / QUARANTINE).iterdir(), key=lambda file: file.stat().st_mtime_ns)
    assert xr.load_dataset(found[-1]).attrs == {"title": "mine"}
    assert computed == []


def test_files_of_others_are_read_if_the_library_can_and_ours_by_others(tmp_path, monkeypatch):
    dataset, path = a_run(), tmp_path / "a.nc"
    write_dataset(dataset, path)
    whole = path.read_bytes()
    with xr.open_dataset(path) as read:
        xr.testing.assert_identical(read, dataset)
    # The netCDF library drops the hash; what it writes is not ours.
    with netCDF4.Dataset(path, "a") as file:
        file.title = "another"
    with pytest.raises(CorruptError):
        read_dataset(path)
    dataset.to_netcdf(path)
    xr.testing.assert_identical(read_dataset(path), dataset)
    monkeypatch.setattr(netcdf_file, "LIMIT", 1.0)
    monkeypatch.setattr(netcdf_file, "_KNOWN", set())
    sealed = tmp_path / "sealed.nc"
    sealed.write_bytes(whole)
    for code in ("while True: pass", "import os; os.abort()"):
        monkeypatch.setattr(netcdf_file, "READ", code)
        # Anybody can write the hash of a file.
        for other in (path, sealed):
            with pytest.raises(CorruptError, match=str(other)):
                read_dataset(other)
        assert not netcdf_file.is_result(sealed)
    xr.testing.assert_identical(read_dataset(sealed, stored=True), dataset)


# Whose results these are


def test_of_two_studies_of_one_name_the_last_is_stored_and_told(place, computed, caplog):
    other = small_study(place / "other", GRID.replace("[2, 3]", "[3, 4]"), "pod")
    out, path = place / "out", place / "out" / "studies" / "small.nc"
    caplog.set_level(logging.INFO, "vehiclemor")
    for study, ranks in ((other, [3, 4]), (place / "small.toml", [2, 3]), (other, [3, 4])):
        before = len(caplog.messages)
        # What stands there is of the other.
        with pytest.raises(InputError):
            stored_result(str(study), out)
        for _ in range(2):
            assert list(run(study, out)["rank"].values) == ranks
        assert list(stored_result(str(study), out)["rank"].values) == ranks
        assert [str(path) in message for message in caplog.messages[before:]] == [True]
    # The run that both have is computed once.
    assert len(computed) == 1
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    both = place / "both.toml"
    paths = json.dumps([str(other), str(place / "small.toml")])
    both.write_text(f'title = "both"\nstudies = {paths}\n')
    assert [found["rank"].values[0] for found in run_studies(str(both), out).values()] == [3, 2]
    assert len(computed) == 1


def test_a_study_that_was_renamed_is_combined_again(place, computed):
    path = (place / "small.toml").rename(place / "renamed.toml")
    before = reread(place)
    after = run_studies(str(path), place / "out")["renamed"]
    xr.testing.assert_equal(after.drop_vars(TIMED), before)
    assert after.attrs["study"] == "renamed"
    names = sorted(p.name for p in (place / "out" / "studies").iterdir())
    assert names == ["renamed.nc", "small.nc"]
    assert computed == []


def test_a_label_that_was_edited_is_in_the_results(place, computed):
    path = place / "small.toml"
    path.write_text(path.read_text().replace('method = "pod"', 'method = "pod"\nlabel = "mine"'))
    assert run(path, place / "out")["label"].values.tolist() == ["mine"]
    assert computed == []

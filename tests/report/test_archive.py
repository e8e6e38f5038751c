"""Archive of stored results: complete, checked by hashes, and a results folder once unpacked."""

import hashlib
import zipfile

import archive

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.netcdf_file import read_dataset, write_dataset


def test_an_archive_is_the_results_folder_again(tmp_path, capsys):
    results, out, unpacked = tmp_path / "results", tmp_path / "a.zip", tmp_path / "unpacked"
    (results / "studies").mkdir(parents=True)
    stored = vm.simulate("double_wishbone", "pod").expand_dims(label=["pod"])
    write_dataset(stored, results / "studies" / "mine.nc")
    (results / "peers.json").write_text("{}")
    archive.main(results, out)
    with zipfile.ZipFile(out) as file:
        file.extractall(unpacked)
    again = read_dataset(unpacked / "studies" / "mine.nc", "source", "vehiclemor")
    assert again.identical(read_dataset(results / "studies" / "mine.nc", "source", "vehiclemor"))
    sums = dict(
        line.split()[::-1] for line in (unpacked / "SHA256SUMS.txt").read_text().splitlines()
    )
    assert {"studies/mine.nc", "tables/mine.csv", "peers.json", "README.txt"} <= sums.keys()
    for name, digest in sums.items():
        assert hashlib.sha256((unpacked / name).read_bytes()).hexdigest() == digest
    picture = tmp_path / "mine.png"
    assert main(["plot", "mine", "--results", str(unpacked), "--out", str(picture)]) == 0
    assert picture.exists()
    assert f"{len(sums) + 1} files" in capsys.readouterr().out

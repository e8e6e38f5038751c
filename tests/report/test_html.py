"""The HTML report: whole, alone, escaped, and every number with the cell that it comes from."""

import hashlib
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.cli import main
from vehiclemor.report.html import interactive, study_table
from vehiclemor.report.html import study_section as html_study
from vehiclemor.report.html.document import _stored
from vehiclemor.report.html.page import page
from vehiclemor.report.html.study_section import study_section
from vehiclemor.report.html.verdict_section import verdict_section
from vehiclemor.report.predictive.rows import method_rows, protocol_of
from vehiclemor.study import netcdf_file, timing
from vehiclemor.study.netcdf_file import read_dataset

HOSTILE = "</title></script><script>alert(1)</script> & \"x\" 'y' --> <!-- ${z} {{ 1 + 1 }}"
STUDY = f"""
title = {json.dumps(HOSTILE)}
model = "double_wishbone"
training = "nominal"
keep = "metrics"
[grid]
frequency_factor = [0.9, 1.0, 1.2]
[[methods]]
method = "pod"
settings = {{ rank = 3 }}
[[methods]]
method = "replay"
label = {json.dumps(HOSTILE)}
"""
VEHICLE = """
title = "a lane change"
model = "independent_suspension_vehicle"
[[methods]]
method = "replay"
"""
PROTOCOL = """
title = "unseen travels"
model = "double_wishbone"
bounds.spindle_y = { measure = "rms", bound = 7.57e-5 }
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", points = [[1.3, 1.0]] }]
test = [{ maneuver = "sine_travel", points = [[0.9, 1.0], [1.1, 0.8]] }]
contestants = [
    { label = "newton", method = "full_order", role = "full order" },
    { label = "fixed basis", method = "fixed_basis", candidates = [{ rank = 3 }] },
]
targets = [{ against = "within bounds", ratio = 2.0 }]
"""
VOID = {"meta", "link", "br", "img", "input", "hr"}
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


class Page(HTMLParser):
    """A page that was read: elements, texts of tables, what stands in which element."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.rows, self.within = [], [], [], {}
        self.texts = {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        assert len(found) == len(attrs), f"{tag} has an attribute twice"
        self.elements.append((tag, found))
        if tag not in VOID:
            self.open.append((tag, found))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append({"text": "", "value": None, "anchor": ""})
        if self.rows and self.rows[-1] and "td" in [t for t, _ in self.open]:
            cell = self.rows[-1][-1]
            cell["value"] = found.get("value", cell["value"])
            cell["anchor"] = found.get("href", cell["anchor"])

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> ends nothing"
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        tags = [tag for tag, _ in self.open]
        for _, attributes in self.open:
            for key in ("id", "data-for"):
                if key in attributes:
                    name = attributes[key]
                    self.texts[name] = self.texts.get(name, "") + data
        if tags:
            self.texts[tags[-1]] = self.texts.get(tags[-1], "") + data
        if "td" in tags or "th" in tags:
            self.rows[-1][-1]["text"] += data


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "PROTOCOL_ROUNDS", 2)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder of results, and the text of the report of all of them."""
    folder = tmp_path_factory.mktemp("html")
    (folder / "unseen.toml").write_text(PROTOCOL)
    protocol = f'title = "x"\nprotocols = [{json.dumps(str(folder / "unseen.toml"))}]\n'
    for name, text in {"hostile": STUDY, "lane": VEHICLE, "mine": protocol}.items():
        (folder / f"{name}.toml").write_text(text)
    names = [str(folder / f"{name}.toml") for name in ("hostile", "lane", "mine")]
    assert main(["report", *names, "--results", str(folder), "--out", str(folder / "a.html")]) == 0
    return folder, (folder / "a.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def read(made):
    return Page(made[1])


@pytest.fixture
def undrawn(monkeypatch):
    """Without vector figures, which take most of the time."""
    monkeypatch.setattr(html_study, "_pictures", lambda *_: [])


def dataset_of(folder, name):
    return read_dataset(folder / "studies" / f"{name}.nc", "source", "vehiclemor")


def assert_linked(found):
    ids = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [a["href"] for tag, a in found.elements if "href" in a and tag != "link"]
    assert links
    assert {link[1:] for link in links} <= set(ids)
    used = {
        name
        for _, attributes in found.elements
        for value in attributes.values()
        for name in re.findall(r"url\(#([^)]+)\)", value or "")
    }
    labels = {a["aria-labelledby"] for _, a in found.elements if "aria-labelledby" in a}
    assert used | labels <= set(ids)


def test_every_element_ends_and_every_link_has_its_anchor(read):
    assert_linked(read)


def test_nothing_outside_of_the_file_is_loaded(made, read):
    for tag, attributes in read.elements:
        loaded = [attributes.get(name) for name in ("src", "srcset", "data", "poster", "action")]
        assert not any(loaded) or tag == "data"
        if tag == "link":
            assert attributes["href"] == "data:,"
        if tag == "image":
            assert attributes["href"].startswith("data:")
    policy = next(a["content"] for tag, a in read.elements if "http-equiv" in a)
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    styles = read.texts["style"]
    assert "url(" not in styles
    assert "@import" not in styles


def test_hostile_titles_are_texts(read):
    title = " ".join(HOSTILE.split())
    assert read.texts["study-hostile"] == HOSTILE
    assert "{{ 1 + 1 }}" in title
    scripts = [attributes for tag, attributes in read.elements if tag == "script"]
    # The library, the page's own, and data of plots: nothing runs that is not the package's.
    assert [s for s in scripts if s.get("type") != "application/json"] == [{}, {}]
    assert any(row[0]["text"] == HOSTILE for row in read.rows)
    plot = json.loads(read.texts["plot-hostile-errors-1"])
    assert "alert(1)" in json.dumps(plot)


def numbers_of(found, method):
    """Rows of tables whose first column is a method's: heading -> cell."""
    heads = []
    rows = []
    for row in found.rows:
        names = [cell["text"].strip() for cell in row]
        if names[0] in ("method", "contestant"):
            heads = names
        elif names[0].startswith(method) and len(heads) == len(row):
            rows.append(dict(zip(heads, row, strict=True)))
    return rows


def test_every_number_is_that_of_the_dataset(made, read):
    dataset = dataset_of(made[0], "hostile")
    rows = numbers_of(read, "POD")
    assert len(rows) == 3
    for row in rows:
        factor = float(row["frequency factor"]["value"])
        place = dataset.sel({"method": "pod", "frequency_factor": factor}).squeeze()
        for output, words in (
            ("spindle_y", "spindle displacement, RMS error (m)"),
            ("second_euler_angle", "second Euler angle, RMS error (rad)"),
        ):
            cell, value = row[words], place["rms_error"].sel(output=output).item()
            assert float(cell["value"]) == value
            assert float(cell["text"]) == pytest.approx(value, rel=5e-3)
            assert cell["anchor"] == f"#cell-{place['cell_key'].item()}"
        assert int(row["iterations"]["value"]) == place["iterations"].item()


def test_a_link_leads_to_all_that_determines_the_cell(made, read):
    anchors = {cell["anchor"][1:] for row in read.rows for cell in row if cell["anchor"]}
    cells = {anchor for anchor in anchors if anchor.startswith("cell-")}
    # Of the grid three and what replay shares, one lane change, two contestants.
    assert len(cells) == len(np.unique(dataset_of(made[0], "hostile")["cell_key"])) + 3
    for anchor in cells:
        text = re.sub(r"(value-\w+), below", r'"\1"', read.texts[anchor])
        content = json.loads(text)
        for name, value in content.items():
            if str(value).startswith("value-"):
                content[name] = json.loads(read.texts[value])
        key = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:20]
        assert anchor == f"cell-{key}"


def test_a_protocol_shows_its_contestants_and_targets(made, read):
    dataset = dataset_of(made[0], "predictive-unseen")
    rows = {row["method"]: row for row in method_rows(dataset, protocol_of(dataset))}
    (shown,) = numbers_of(read, "fixed basis")
    expected = rows["fixed basis"]
    assert float(shown["misses"]["value"]) == expected["misses"]
    assert float(shown["worst error / bound"]["value"]) == expected["score"]
    assert float(shown["whole call (µs)"]["value"]) == 1e6 * expected["seconds"]
    targets = [row for row in read.rows if row[0]["text"].startswith("speed-up")]
    assert targets[0][4]["text"] in ("met", "missed", "not comparable")


def test_paths_and_runs_can_be_looked_into(read):
    for name in ("plot-lane-paths-1", "plot-predictive-unseen-runs-1", "plot-hostile-errors-1"):
        assert json.loads(read.texts[name])["doc"]["roots"]


def test_without_the_extra_it_says_what_is_missing(made, undrawn, monkeypatch):
    monkeypatch.setattr(interactive, "find_spec", lambda _: None)
    folder, with_plots = made
    text = page([study_section(dataset_of(folder, "hostile"), folder, {})], {})
    assert "vehiclemor[html]" in text
    assert "vehiclemor[html]" not in with_plots
    assert "plot-" not in text
    assert_linked(Page(text))


def test_a_large_grid_is_summed_up_with_links(made, undrawn, monkeypatch):
    monkeypatch.setattr(study_table, "MOST_ROWS", 5)
    folder = made[0]
    dataset = dataset_of(folder, "hostile")
    found = Page(page([study_section(dataset, folder, {})], {}))
    assert_linked(found)
    (row,) = numbers_of(found, "POD")
    errors = dataset["rms_error"].sel({"method": "pod", "output": "spindle_y"}).values.ravel()
    shown = [float(row[f"spindle displacement, RMS error (m), {word}"]["value"]) for word in WORDS]
    assert shown == [errors.min(), np.median(errors), errors.max()]


WORDS = ("least", "median", "largest")


def test_a_study_that_is_read_in_parts_gives_the_same(made, undrawn, monkeypatch):
    folder = made[0]
    sections = []
    for large in (netcdf_file.LARGE, 0):
        monkeypatch.setattr(netcdf_file, "LARGE", large)
        sections.append(study_section(dataset_of(folder, "hostile"), folder, {}))
    one, other = sections
    assert one._replace(plots=[]) == other._replace(plots=[])


def test_results_of_before_cells_were_named_are_shown(made, undrawn):
    folder = made[0]
    found = Page(
        page([study_section(dataset_of(folder, "hostile").drop_vars("cell_key"), folder, {})], {})
    )
    assert_linked(found)
    assert "did not name the cells" in found.texts["place-hostile-0"]


def test_verdicts_lead_to_cells_and_studies(results, results_folder):
    stored = _stored(results_folder)
    if not stored.timings:
        pytest.skip("no test before this one has timed the models")
    section = verdict_section(stored.studies, stored.timings)
    rows = [row for table in section.tables for row in table.rows if table.columns[0] == "item"]
    anchors = [row[6].anchor for row in rows]
    keys = {f"cell-{key}" for d in results.values() for key in d["cell_key"].values.ravel()}
    ids = {f"study-{name}" for name in results} | {table.id for table in section.tables}
    assert set(anchors) <= keys | ids | {""}
    # Two errors of each model, by two variants; of the vehicles from two starts.
    assert sum(anchor in keys for anchor in anchors) == 20
    shown = {
        row[6].anchor: row[6].value
        for row in rows
        if row[0].text.startswith("RMS error of the pitch")
    }
    vehicle = results["figures-2-4"].stack(place=results["figures-2-4"]["status"].dims)
    for anchor, value in shown.items():
        cell = vehicle.isel(place=np.flatnonzero(vehicle["cell_key"].values == anchor[5:])[0])
        error = cell["rms_error"].sel(output="pitch").item()
        assert value == error or (value is None and error != error)


def test_a_damaged_file_is_named_and_left_out(made, tmp_path):
    (tmp_path / "studies").mkdir()
    shutil.copy(made[0] / "studies" / "predictive-unseen.nc", tmp_path / "studies")
    (tmp_path / "studies" / "broken.nc").write_bytes(b"nothing")
    text = vm.write_report(out=tmp_path / "c.html", results=tmp_path).read_text(encoding="utf-8")
    assert "broken.nc" in text
    # Its cells are not here: what the study's file says of them stands for them.
    assert "not among the results" in text
    assert_linked(Page(text))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no results of a study"),
        (["--out", "report.pdf"], "ends with .html"),
        (["--out", "nowhere/report.html"], "does not exist"),
        (["nonsense"], "nonsense"),
    ],
)
def test_wrong_input_is_one_line(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report", *arguments]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert words in told
    assert list(tmp_path.glob("*.html")) == []


@pytest.mark.parametrize("studies", [3, [3], ["no-such-study"]])
def test_wrong_names_in_python_are_one_line(studies, tmp_path):
    with pytest.raises(vm.VehiclemorError, match="stud") as caught:
        vm.write_report(studies, tmp_path / "d.html", tmp_path)
    assert "\n" not in str(caught.value)


# Both frames tell how far their pages are wider than they; a frame can be as narrow as a telephone.
FRAMES = """<!DOCTYPE html><body><p id="told">nothing</p>
<iframe src="{name}" width="400" height="3000"></iframe>
<iframe src="{name}" width="1400" height="3000"></iframe>
<script>
const pages = () => [...document.querySelectorAll("iframe")].map((f) => f.contentDocument);
let left = 700;
function tell() {{
  const found = pages().map((page) => [
    page.documentElement.scrollWidth - page.documentElement.clientWidth,
    page.querySelectorAll(".plot > *").length,
  ]);
  if (left-- && found.some(([, plots]) => plots < 1)) setTimeout(tell, 250);
  else document.getElementById("told").textContent = JSON.stringify(found);
}}
onload = tell;
</script></body>"""


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_a_browser_shows_it_without_errors_at_both_widths(made, tmp_path):
    frames = Path(made[0]) / "frames.html"
    frames.write_text(FRAMES.format(name="a.html"))
    flags = "headless no-sandbox disable-gpu no-first-run disable-background-networking"
    flags += " disable-component-update disable-sync allow-file-access-from-files dump-dom"
    options = [f"--{flag}" for flag in flags.split()]
    options += ["--enable-logging=stderr", "--virtual-time-budget=200000"]
    options += ["--window-size=1900,3000"]
    done = subprocess.run(
        [CHROMIUM, *options, f"--user-data-dir={tmp_path}", frames.as_uri()],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in console if "[bokeh" not in line or "rror" in line] == []
    for wider, plots in json.loads(Page(done.stdout).texts["told"]):
        assert wider <= 0
        assert plots >= 1

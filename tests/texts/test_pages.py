"""README and handbook describe what is there: links, quoted files, commands, examples."""

import re
import runpy
import tomllib
from configparser import ConfigParser

import numpy as np
import pytest
import schemas

import vehiclemor
from tests.plugin.installation import installed
from tests.texts.markdown import NAMES, ROOT, TEXTS, blocks, console_commands, inline_commands
from vehiclemor.cli.app import app, main
from vehiclemor.exporting import fmu
from vehiclemor.report.figures import theme
from vehiclemor.report.published import citations
from vehiclemor.study.plans.loading import study_path

README, HANDBOOK = ROOT / "README.md", ROOT / "paper" / "handbook"
FIRST_STEPS, PLUG_IN = HANDBOOK / "first-steps.md", HANDBOOK / "my-plug-in.md"
STUDY_FILES, TEN_THOUSAND = HANDBOOK / "study-files.md", HANDBOOK / "ten-thousand-maneuvers.md"
TASKS = ROOT / "paper" / "tasks"
PAGES = pytest.mark.parametrize("path", TEXTS, ids=NAMES)


@PAGES
def test_links_lead_somewhere(path):
    text = re.sub(r"```.*?```|`[^`]*`", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        file, _, anchor = link.partition("#")
        if not file.startswith("https://"):
            target = (path.parent / file).resolve() if file else path
            assert target.is_file(), link
            assert not anchor or anchor in _anchors(target.read_text(encoding="utf-8")), link


def _anchors(text: str) -> set[str]:
    """Anchors that GitHub gives to headings."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_files_scripts_and_environments_that_a_page_names_are_there():
    tox, folders = ConfigParser(), "src|tests|data|paper|benchmarks|examples"
    tox.read(ROOT / "tox.ini")
    for path in TEXTS:
        text = path.read_text(encoding="utf-8")
        for name in re.findall(rf"`((?:{folders})/[\w/.-]+)`", text):
            assert (ROOT / name).exists(), name
        for name in re.findall(r"tox -e (\w+)", text):
            assert f"testenv:{name}" in tox, name
        for script in re.findall(r"python (paper/\w+\.py)", text):
            assert f"Usage: python {script}" in (ROOT / script).read_text(encoding="utf-8")
        for block in blocks(path):
            if quoted := re.fullmatch(r"`([\w/.-]+)`:", block.above):
                content = (ROOT / quoted[1]).read_text(encoding="utf-8")
                assert block.content == content, quoted[1]
            if block.language == "toml":
                tomllib.loads(block.content)


def test_the_page_of_schemas_is_current():
    assert schemas.PAGE.read_text(encoding="utf-8") == schemas.page(), "run paper/schemas.py"


# Parsed and not run, here: what takes long.  Their options are checked, and the names of studies.
@PAGES
def test_commands_can_be_parsed(path):
    for words in [*console_commands(path), *inline_commands(path)]:
        if words[0] == "vehiclemor" and len(words) == 2:
            assert words[1] in app, words
        elif words[0] == "vehiclemor":
            app.parse_args(words[1:], exit_on_error=False, print_error=False)
            if words[1] == "run" and not words[2].startswith("my_"):
                study_path(words[2])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # One picture of each figure is enough here, and machine code that is not optimised.
    monkeypatch.setattr(theme, "FORMATS", ("png",))
    monkeypatch.setattr(fmu, "OPTIMISED", ("-std=c99", "-O0"))
    return tmp_path


@pytest.mark.parametrize("path", [README, FIRST_STEPS], ids=["README", "first steps"])
def test_console_blocks_run(path, here, capsys):
    for words in console_commands(path):
        assert words[0] == "vehiclemor"
        assert main(words[1:]) == 0, words
    capsys.readouterr()
    assert list(here.glob("*.png"))


def test_the_example_of_readme_runs_and_shows_what_readme_says(here, capsys):
    (code,) = [block.content for block in blocks(README) if block.language == "python"]
    (here / "example.py").write_text(code)
    runpy.run_path("example.py")
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    errors = {words[0]: float(words[1]) for words in lines}
    # Off by as much as what computes nothing.
    assert errors["pod"] == pytest.approx(errors["replay"], rel=0.1)


def test_the_example_study_runs(here, capsys):
    names = re.findall(r"Saved as `([\w.]+)`", STUDY_FILES.read_text(encoding="utf-8"))
    studies = [block.content for block in blocks(STUDY_FILES) if block.language == "toml"]
    for name, content in zip(names, studies, strict=False):
        (here / name).write_text(content)
    code = [block.content for block in blocks(STUDY_FILES) if block.language == "python"]
    (here / "example.py").write_text("\n".join(code))
    runpy.run_path("example.py")
    told = capsys.readouterr().out
    assert "frequency_factor" in told
    assert "path_map" in told
    for words in console_commands(STUDY_FILES):
        assert main(words[1:]) == 0, words


def test_a_plug_in_is_made_step_by_step(here, capsys):
    first, *rest = console_commands(PLUG_IN)
    assert main(first[1:]) == 0
    (code,) = [b.content for b in blocks(PLUG_IN) if b.language == "python" and b.above[:1] != "`"]
    (here / "example.py").write_text(code)
    with installed(here / "my_car_plugin"):
        runpy.run_path("example.py")
        for words in rest:
            assert main(words[1:]) == 0, words
    capsys.readouterr()
    there = {path.name for path in here.iterdir()}
    assert there >= {"my_car", "my_car_plugin", "results", "report.html"}
    assert list((here / "results" / "figures").glob("*.png"))


@pytest.mark.parametrize(
    "name",
    [
        "export",
        "keep-a-model",
        "my-loop",
        "my-signal",
        "predictive-control",
        "ten-thousand-maneuvers",
    ],
)
def test_the_code_of_a_page_runs(name, here, capsys):
    page = HANDBOOK / f"{name}.md"
    # Files that are quoted have tests of their own.
    own = [b.content for b in blocks(page) if b.language == "python" and b.above[:1] != "`"]
    (here / "page.py").write_text("\n".join(own).replace("10_000", "100"))
    runpy.run_path("page.py")
    assert capsys.readouterr().out


def test_lines_of_user_code_are_those_of_the_scripts():
    told = re.findall(r"\[(\d+)\]\(../tasks/(\w+).py\)", TEN_THOUSAND.read_text(encoding="utf-8"))
    paths = {path.stem: path for path in TASKS.glob("*.py") if path.stem != "maneuvers"}
    # All but the first line, which says what it is, and empty ones.
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    counts = {
        name: len([*filter(str.strip, text.splitlines())]) - 1 for name, text in texts.items()
    }
    assert {name: int(lines) for lines, name in told} == counts


@pytest.mark.parametrize("name", ["step", "step_full", "fresh_input", "fresh_input_full"])
def test_a_task_runs(name, monkeypatch):
    monkeypatch.syspath_prepend(TASKS)
    found = runpy.run_path(str(TASKS / f"{name}.py"))
    result = found["run"].outputs if "run" in found else found["state"]
    assert np.isfinite(result).all()


def test_hard_points_of_the_design_are_an_optimum_within_bounds_that_the_path_map_finds():
    design = runpy.run_path(str(ROOT / "examples" / "design.py"))
    full = design["Designer"]("full_order", 2)
    found = {way: design["hard_points"](way, 2) for way in ("full_order", "path_map")}
    np.testing.assert_allclose(found["path_map"], found["full_order"], atol=1e-7)
    place = found["full_order"]
    slope = full.off(place) @ full.slopes(place)
    at = np.sign(place) * (np.abs(place) > design["LARGEST"] * (1.0 - 1e-4))
    assert 0 < np.count_nonzero(at) < len(at)
    assert np.abs(slope[at == 0]).max() < 1e-4 * np.abs(slope).max()
    assert (slope[at != 0] * at[at != 0] < 0.0).all()


def test_citation_names_this_version_and_the_published_paper():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    paper = dict(re.findall(r"(\w+) += {+(.*?)}+,", citations().partition("@article")[2]))
    assert f"\nversion: {vehiclemor.__version__}\n" in citation
    assert f"\n## {vehiclemor.__version__}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    told = [f'"{paper[key]}"' for key in ("title", "journal")]
    for value in (*told, paper["doi"], f"year: {paper['year']}"):
        assert value in citation
    assert paper["doi"] in README.read_text(encoding="utf-8")

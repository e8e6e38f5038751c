"""README and pages describe what is there: files, commands, code.  Sphinx checks their links."""

import ast
import json
import re
import runpy
import shlex
import tomllib
from configparser import ConfigParser
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import vehiclemor as vm
from tests.plugin.installation import installed
from vehiclemor.cli.app import app, main
from vehiclemor.exporting import fmu
from vehiclemor.report.figures import theme
from vehiclemor.report.published import citations
from vehiclemor.study import timing
from vehiclemor.study.plans.loading import study_path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GENERATED = DOCS / "study-file-reference.md"
TEXTS = [ROOT / "README.md", *sorted({*DOCS.glob("*.md")} - {GENERATED})]
NAMES = [str(path.relative_to(ROOT)) for path in TEXTS]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block, and the line above it."""

    language: str
    content: str
    above: str


def blocks(path: Path) -> list[Block]:
    text = path.read_text(encoding="utf-8")
    found = FENCED.finditer(text)
    return [Block(m[1], m[2], text[: m.start()].rstrip().rpartition("\n")[2]) for m in found]


def console_commands(path: Path) -> list[list[str]]:
    """Commands of the `console` blocks, in order."""
    lines = "".join(b.content for b in blocks(path) if b.language == "console").splitlines()
    return [shlex.split(line[2:], comments=True) for line in lines if line.startswith("$ ")]


def inline_commands(path: Path) -> list[list[str]]:
    """Commands of this package in running text; capitals stand for what a reader puts there."""
    prose = FENCED.sub("", path.read_text(encoding="utf-8"))
    spans = (" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose))
    commands = [shlex.split(span) for span in spans if span.startswith("vehiclemor ")]
    return [words for words in commands if not any(w.isupper() and len(w) > 1 for w in words)]


README, EXTENDING, STUDIES = ROOT / "README.md", DOCS / "extending.md", DOCS / "studies.md"
PAGES = pytest.mark.parametrize("path", TEXTS, ids=NAMES)
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@PAGES
def test_links_lead_somewhere_in_the_repository(path):
    text = re.sub(r"```.*?```|`[^`]*`", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)\s#]+)", text)
    missing = [link for link in links if ":" not in link and not (path.parent / link).is_file()]
    assert missing == []


@PAGES
def test_files_scripts_and_environments_that_a_page_names_are_there(path):
    tox, folders = ConfigParser(), "src|tests|data|paper|benchmarks|examples|docs"
    tox.read(ROOT / "tox.ini")
    text = path.read_text(encoding="utf-8")
    for name in re.findall(rf"`((?:{folders})/[\w/.-]+)`", text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"tox -e (\w+)", text):
        assert f"testenv:{name}" in tox, name
    for name in re.findall(r"python ((?:paper|examples)/\w+\.py)", text):
        assert (ROOT / name).exists(), name
    for block in blocks(path):
        if quoted := re.fullmatch(r"`([\w/.-]+)`:", block.above):
            assert block.content == (ROOT / quoted[1]).read_text(encoding="utf-8"), quoted[1]
        if block.language == "toml":
            tomllib.loads(block.content)


def test_functions_that_the_page_on_the_method_names_are_in_their_files():
    page = (DOCS / "method.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\|.*\| `([\w/]+\.py)` \| (`.*`) \|$", page, re.MULTILINE)
    assert len(rows) > 8
    for file, functions in rows:
        source = (ROOT / "src" / "vehiclemor" / file).read_text(encoding="utf-8")
        for name in re.findall(r"`([\w.]+)`", functions):
            assert re.search(rf"(def|class) {name.split('.')[-1]}\b", source), (file, name)


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
    # Times are measured, but no test asks how well.
    for rounds in ("PROTOCOL_ROUNDS", "PROTOCOL_ROUNDS_OF_LONG"):
        monkeypatch.setattr(timing, rounds, 1)
    return tmp_path


def run_code(path, folder) -> dict:
    """All Python of a page, one block behind the other, but what needs another machine."""
    code = [b.content for b in blocks(path) if b.language == "python"]
    code = [part for part in code if "METHOD = " not in part and "SLURMCluster" not in part]
    (folder / "page.py").write_text("\n".join(code).replace("10_000", "100"))
    return runpy.run_path("page.py")


@pytest.mark.parametrize("name", ["first-steps", "method", "reduced-models", "handling"])
def test_code_and_commands_of_a_page_run(name, here, capsys):
    run_code(DOCS / f"{name}.md", here)
    for words in console_commands(DOCS / f"{name}.md"):
        assert main(words[1:]) == 0, words
    capsys.readouterr()
    assert name in ("method", "handling") or list(here.glob("*.png"))


def test_the_example_of_readme_runs(here, capsys):
    made = run_code(README, here)
    # POD repeats its training run, which has less steering.
    assert made["run"]["lateral_position"][-1] < 0.9 * made["full"]["lateral_position"][-1]
    assert np.isfinite(made["state"]).all()
    assert "lateral_position" in capsys.readouterr().out


def test_the_example_studies_run(here, capsys):
    names = re.findall(r"Saved as `([\w.]+)`", STUDIES.read_text(encoding="utf-8"))
    written = [block.content for block in blocks(STUDIES) if block.language == "toml"]
    assert len(names) == len(written)
    for name, content in zip(names, written, strict=True):
        # A fit that runs are compared with once, and times of one run, are enough here.
        quick = content.replace('"slow_manifold"', '"slow_manifold"\ncandidates = [{ steps = 1 }]')
        (here / name).write_text(re.sub(r"(rows = .*)(\ntimed = 1)?", r"\1\ntimed = 1", quick))
    run_code(STUDIES, here)
    assert "frequency_factor" in capsys.readouterr().out
    for words in console_commands(STUDIES):
        assert main(words[1:]) == 0, words


def test_a_plug_in_is_made_step_by_step(here, capsys):
    first, *rest = console_commands(EXTENDING)
    assert main(first[1:]) == 0
    with installed(here / "my_car_plugin"):
        run_code(EXTENDING, here)
        for words in rest:
            assert main(words[1:]) == 0, words
    capsys.readouterr()
    there = {path.name for path in here.iterdir()}
    assert there >= {"my_car", "my_car_plugin", "results", "report.html"}
    assert list((here / "results" / "figures").glob("*.png"))


def used(path) -> set[str]:
    """Names that an example takes from this package."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vehiclemor"):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            names |= {node.attr} if node.value.id == "vm" else set()
    return names


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_uses_names_of_the_api_reference_alone(path):
    reference = (DOCS / "api.rst").read_text(encoding="utf-8")
    promised = set(re.findall(r"^\.\. auto\w+:: (\S+)$", reference, re.MULTILINE))
    assert set(vm.__all__) <= promised
    assert used(path) <= promised
    assert path.stem in (DOCS / "examples.py").read_text(encoding="utf-8")


def test_the_linter_before_a_commit_is_that_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    linter = project["dependency-groups"]["style"][0]
    assert f'"{linter}"' in (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")


def test_citation_names_this_version_and_the_published_paper():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    paper = dict(re.findall(r"(\w+) += {+(.*?)}+,", citations().partition("@article")[2]))
    described = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert f"\nversion: {vm.__version__}\n" in citation
    assert described["version"] == vm.__version__
    assert f"\ndate-released: {described['dateModified']}\n" in citation
    assert f"\n## {vm.__version__}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    told = [f'"{paper[key]}"' for key in ("title", "journal")]
    for value in (*told, paper["doi"], f"year: {paper['year']}"):
        assert value in citation
    assert paper["doi"] in README.read_text(encoding="utf-8")

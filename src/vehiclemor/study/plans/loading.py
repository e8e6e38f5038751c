"""Study files by name or path: the study itself, or the members of a collection."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.files import write_text
from vehiclemor.registry import choice
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.toml_files import FileSchema, fitting, toml_content

# Between entries of a long list.
LINE = ",\n  "
# Bytes of the name of a study: those of its results and pictures are longer.
LONGEST_NAME = 180


def is_study(name: str) -> bool:
    """Whether a name is that of a study: a TOML file, or a name from the package's data."""
    return name.endswith(".toml") or name in data_names("studies")


def study_path(study: str) -> Path:
    """Path of a study: a name from the package's data, or a TOML file."""
    path = file_path("study", study)
    if study.endswith(".toml"):
        if len(path.stem.encode()) > LONGEST_NAME:
            raise InputError(f"study {path}: its name has more than {LONGEST_NAME} characters")
        return path
    return data_folder() / "studies" / f"{choice('study', study, data_names('studies'))}.toml"


def read_study(path: Path) -> StudyFile:
    """What a file says, and what it takes from the study that it extends.

    `FileError` if one of them is missing or wrong.
    """
    content = toml_content(path)
    rows, name = content.pop("rows", []), str(content.get("extends", ""))
    if not isinstance(rows, list) or (rows and not name):
        raise FileError(f"{path}: rows is a list of labels, of a study that extends another")
    if name:
        try:
            base = toml_content(study_path(name))
            if "extends" in base or "studies" in base:
                raise InputError(f"{name} extends a study itself, or is a collection")
            entries = {e.get("label", e.get("method")): e for e in base.pop("methods", [])}
            methods = [
                entries[choice("row of the extended study", str(row), entries)] for row in rows
            ]
        except InputError as error:
            raise FileError(f"{path}: extends: {error}") from None
        content = base | content | {"methods": [*methods, *content.get("methods", [])]}
    return fitting(path, content, StudyFile)


def load_studies(study: str) -> dict[str, StudyFile]:
    """Study name -> definition; a collection gives all of its members."""
    return {name: definition for name, (_, definition) in studies_and_files(study).items()}


def studies_and_files(study: str) -> dict[str, tuple[Path, StudyFile]]:
    """As `load_studies`, with the files."""
    path = study_path(study)
    definition = read_study(path)
    if not definition.studies:
        return {path.stem: (path, definition)}
    members: dict[str, tuple[Path, StudyFile]] = {}
    for member in definition.studies:
        file = study_path(member)
        content = read_study(file)
        if content.studies:
            raise FileError(f"{path}: studies.{member} is a collection itself")
        if content in (other for _, other in members.values()):
            raise FileError(f"{path}: studies.{member}: the same study is in it already")
        # As its combined dataset is named, see `combined_path`.
        double = file.stem in members
        members[f"{file.stem}-{content_hash(content)}" if double else file.stem] = file, content
    return members


def refuse_doubles(studies: Iterable[str]) -> None:
    """Raise `InputError` if two files have one name: results of one would stand for the other."""
    files: dict[str, Path] = {}
    for study in studies:
        for name, (path, _) in studies_and_files(study).items():
            other = files.setdefault(name, path)
            if other.resolve() != path.resolve():
                raise InputError(f"{other} and {path} have one name, {name}: rename one of them")


def content_hash(definition: FileSchema) -> str:
    """Short hash of what a file says."""
    text = definition.model_dump_json(exclude_defaults=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def write_study(definition: StudyFile, path: Path) -> Path:
    """Write what a study says beyond the defaults as a TOML file."""
    content = definition.model_dump(exclude_defaults=True).items()
    # Entries of the longest lists stand on lines of their own.
    lines = [f"{name} = {_toml(value, LINE)}" for name, value in content]
    return write_text(path, "\n".join([*lines, ""]))


def _toml(value: Any, between: str = ", ") -> str:
    if isinstance(value, dict):
        keys = [key if key.isidentifier() else json.dumps(key) for key in value]
        pairs = zip(keys, map(_toml, value.values()), strict=True)
        return f"{{ {', '.join(f'{key} = {text}' for key, text in pairs)} }}"
    if isinstance(value, list):
        return f"[{between.join(map(_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)

"""Study files by name or path: the study itself, or the members of a collection."""

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vehiclemor.arguments import file_path
from vehiclemor.exceptions import FileError, InputError
from vehiclemor.files import data_folder, data_names, write_text
from vehiclemor.registry import choice
from vehiclemor.study.plans.study_file import OF_TEST, SETS, CollectionFile, StudyFile, schema_of
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


def read_study(path: Path) -> StudyFile | CollectionFile:
    """The study of a file, with what it takes from others; `FileError` if one of them is wrong."""
    return _validated(path, _merged(path))


def _validated(path: Path, content: dict[str, Any]) -> StudyFile | CollectionFile:
    try:
        schema = schema_of(content)
    except InputError as error:
        raise FileError(f"{path}: {error}") from None
    # The methods that it names stand among the others.
    return fitting(path, {key: content[key] for key in content if key != "rows"}, schema)


def _merged(path: Path, readers: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Content of a file, with all but the methods of the study that it extends, and with rows."""
    content = toml_content(path)
    extended = str(content.get("extends", ""))
    readers = (*readers, path.resolve())
    base: dict[str, Any] = {}
    rows: list[Any] = []
    key = "extends"
    try:
        if extended:
            base = _other_content(extended, readers)
            _move_logs(base, study_path(extended).parent, path.parent)
        key = "rows"
        for study, labels in _labels_by_study(content.get("rows", []), extended).items():
            rows += _methods_of(study, labels, readers)
    except InputError as error:
        raise FileError(f"{path}: {key}: {error}") from None
    methods = content.get("methods", [])
    if isinstance(methods, list) and (rows or extended):
        content["methods"] = [*rows, *methods]
    if "extends" in base:
        # Its test set is named after the study that has it.
        content["extends"] = base["extends"]
    if "test" in content:
        base = {key: base[key] for key in base if key not in OF_TEST}
    return base | content


def _move_logs(content: dict[str, Any], old: Path, new: Path) -> None:
    """Give paths of logs from another folder."""
    for part in (part for name in ("logs", *SETS) for part in content.get(name, ())):
        if "log" in part:
            part["log"] = os.path.relpath(old / part["log"], new)


def _labels_by_study(rows: object, extended: str) -> dict[str, list[Any]]:
    """Study -> labels of its methods; a list of labels is of the extended study."""
    if isinstance(rows, list):
        rows = {extended: rows} if rows else {}
    if not isinstance(rows, dict) or "" in rows:
        raise InputError("give a list of labels of the extended study, or a table study -> labels")
    for study, labels in rows.items():
        if not isinstance(labels, list):
            raise InputError(f"{study} has no list of labels")
    return rows


def _other_content(study: str, readers: tuple[Path, ...]) -> dict[str, Any]:
    """Validated content of another study."""
    path = study_path(study)
    if path.resolve() in readers:
        raise InputError(f"{study} extends itself")
    content = _merged(path, readers)
    if isinstance(_validated(path, content), CollectionFile):
        raise InputError(f"{study} is a collection")
    return content


def _methods_of(study: str, labels: list[Any], readers: tuple[Path, ...]) -> list[dict[str, Any]]:
    """Those methods of another study that have these labels."""
    methods = _other_content(study, readers)["methods"]
    by_label = {method.get("label") or method["method"]: method for method in methods}
    return [by_label[choice(f"row of {study}", label, by_label)] for label in labels]


def load_studies(study: str) -> dict[str, StudyFile]:
    """Study name -> definition; a collection gives all of its members."""
    return {name: definition for name, (_, definition) in studies_and_files(study).items()}


def studies_and_files(study: str) -> dict[str, tuple[Path, StudyFile]]:
    """Study name -> its file and definition; a collection gives all of its members."""
    path = study_path(study)
    definition = read_study(path)
    if not isinstance(definition, CollectionFile):
        return {path.stem: (path, definition)}
    members: dict[str, tuple[Path, StudyFile]] = {}
    for member in definition.studies:
        file = study_path(member)
        content = read_study(file)
        if isinstance(content, CollectionFile):
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


def write_study(definition: FileSchema, path: Path) -> Path:
    """Write what a study says beyond the defaults as a TOML file."""
    content = definition.model_dump(exclude_defaults=True).items()
    # Entries of the longest lists stand on separate lines.
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

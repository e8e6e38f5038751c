"""Study files by name or path: the study itself, or the members of a collection."""

import hashlib
import json
from pathlib import Path
from typing import Any

from vehiclemor.exceptions import FileError
from vehiclemor.files import write_text
from vehiclemor.registry import choice
from vehiclemor.resources import data_folder, data_names
from vehiclemor.study.plans.study_file import StudyFile
from vehiclemor.toml_files import FileSchema, read_toml

# Between entries of a long list.
LINE = ",\n  "


def study_path(study: str) -> Path:
    """Path of a study: a name from the package's data, or a TOML file."""
    if study.endswith(".toml"):
        return Path(study)
    return data_folder() / "studies" / f"{choice('study', study, data_names('studies'))}.toml"


def load_studies(study: str) -> dict[str, StudyFile]:
    """Study name -> definition; a collection gives all of its members."""
    return {name: definition for name, (_, definition) in studies_and_files(study).items()}


def studies_and_files(study: str) -> dict[str, tuple[Path, StudyFile]]:
    """As `load_studies`, with the files."""
    path = study_path(study)
    definition = read_toml(path, StudyFile)
    if not definition.studies:
        return {path.stem: (path, definition)}
    members: dict[str, tuple[Path, StudyFile]] = {}
    for member in definition.studies:
        file = study_path(member)
        content = read_toml(file, StudyFile)
        if content.studies:
            raise FileError(f"{path}: studies.{member} is a collection itself")
        if content in (other for _, other in members.values()):
            raise FileError(f"{path}: studies.{member}: the same study is in it already")
        # As its combined dataset is named, see `combined_path`.
        double = file.stem in members
        members[f"{file.stem}-{content_hash(content)}" if double else file.stem] = file, content
    return members


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

"""What was derived once is kept on disk, and never taken for that of another source."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit import standard_problems
from vehiclemor.codegen import derivation as kept
from vehiclemor.codegen import sources
from vehiclemor.codegen.derivation import Derivation
from vehiclemor.multibody import definition
from vehiclemor.symbolic.program import Program

NAME = standard_problems.NAME


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where derivations are kept."""
    monkeypatch.setenv("VEHICLEMOR_CACHE", str(tmp_path))
    return tmp_path / "derivations"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """One entry for each time that the plug-in model was derived."""
    made, real = [], standard_problems.derive

    def derive() -> Program:
        made.append("derived")
        return real()

    monkeypatch.setattr(standard_problems, "derive", derive)
    return made


def fetch(name: str = NAME, definition: Any = standard_problems) -> Derivation:
    """As in a process of its own, which remembers nothing."""
    kept._read.cache_clear()
    return kept.derivation(name, definition.derive)


def test_a_model_is_derived_once_and_read_back_as_it_was(folder: Path, calls: list) -> None:
    first = fetch()
    assert calls == ["derived"]
    second = fetch()
    assert calls == ["derived"]
    assert second == first
    assert second is not first


def test_the_source_read_back_computes_what_the_model_says(folder: Path, standard) -> None:
    model = standard(rate=3.0, growth=0.5)
    assert [path.name.rpartition("_")[0] for path in folder.iterdir()] == [NAME]
    x, u = np.array([0.3, -0.7, 0.2, 1.1]), np.array([0.4, 0.9, -0.6])
    expected = [0.2, 3.0 * (0.9 + 0.7) - 0.6, 0.4 - np.sin(0.3), 0.5 * 1.1**2]
    np.testing.assert_allclose(model.derivative(x, u), expected, rtol=1e-15)


def test_what_cant_be_derived_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def derive() -> Program:
        raise ZeroDivisionError

    monkeypatch.setattr(standard_problems, "derive", derive)
    with pytest.raises(ZeroDivisionError):
        fetch()
    assert not folder.exists() or not list(folder.iterdir())


def test_another_source_is_another_derivation(
    folder: Path, calls: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    fetch()
    with monkeypatch.context() as patch:
        patch.setattr(kept, "source_digest", lambda *_: "another source")
        fetch()
        assert len(calls) == 2
        fetch()
        assert len(calls) == 2
    with monkeypatch.context() as patch:
        patch.setattr(kept, "version", lambda _: "0.0.1")
        fetch()
    assert len(calls) == 3
    # All three are kept, and the first one is still that of the source at hand.
    assert len(list(folder.iterdir())) == 3
    fetch()
    assert len(calls) == 3


def test_two_models_have_two_derivations(folder: Path, calls: list) -> None:
    one, two = fetch("one"), fetch("two")
    assert len(calls) == 2
    digests = {path.stem.rpartition("_")[0]: path.stem[-16:] for path in folder.iterdir()}
    assert set(digests) == {"one", "two"}
    assert digests["one"] != digests["two"]
    # What follows from the same equations is the same, whatever the name.
    assert one == two


# Digests of sources


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of two layers and a file."""
    root = tmp_path / "package"
    for name in ("models/a.py", "models/parts/b.py", "symbolic/c.py", "other.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"# {name}\n")
    monkeypatch.setattr(sources, "PACKAGE", root)
    return root


def digest() -> str:
    return sources.source_digest(("models",), ("other.py",))


def test_a_digest_follows_the_source_files_of_its_layers_alone(package: Path) -> None:
    seen = {digest()}
    (package / "symbolic" / "c.py").write_text("changed\n")
    (package / "models" / "notes.txt").write_text("no source\n")
    assert seen == {digest()}
    for name in ("models/a.py", "models/parts/b.py", "other.py"):
        with (package / name).open("a") as file:
            file.write("changed\n")
        seen.add(digest())
    new = package / "models" / "new.py"
    new.write_text("")
    seen.add(digest())
    new = new.rename(package / "models" / "renamed.py")
    seen.add(digest())
    new.unlink()
    (package / "models" / "a.py").unlink()
    seen.add(digest())
    assert len(seen) == 7
    assert sources.source_digest(("models", "symbolic"), ("other.py",)) not in seen


def test_what_the_derivation_goes_by_is_in_its_layers() -> None:
    """Changing the vehicle, the tape or the emitter changes the digest."""
    files = {path.name for layer in kept.LAYERS for path in (sources.PACKAGE / layer).rglob("*.py")}
    assert {"equations.py", "tape.py", "kernel_text.py", "llvm_kernels.py"} <= files


def test_components_of_the_package_are_counted_by_their_layers_alone() -> None:
    none = sources.plug_in_digest(())
    assert sources.plug_in_digest((definition.ModelDefinition,)) == none
    assert sources.plug_in_digest((standard_problems,)) != none

"""After the quick start the command is there, and its status is that of tox."""

import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / ".ci" / "tox"
# Stands for tox: it installs the command into the environment that it is asked for.
TOX = """#!/bin/sh
mkdir -p ".tox/$2/bin"
printf '#!/bin/sh\\necho command of %s' "$2" > ".tox/$2/bin/vehiclemor"
chmod +x ".tox/$2/bin/vehiclemor"
exit "$3"
"""


@pytest.mark.skipif(shutil.which("sh") is None, reason="needs a shell")
@pytest.mark.parametrize("status", [0, 1])
def test_the_command_is_beside_tox(tmp_path, status):
    for folder in (".ci", ".venv/bin"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(SCRIPT, tmp_path / ".ci" / "tox")
    tox = tmp_path / ".venv" / "bin" / "tox"
    tox.write_text(TOX)
    tox.chmod(0o755)

    def call(environment):
        arguments = ["sh", tmp_path / ".ci" / "tox", "-e", environment, str(status)]
        assert subprocess.run(arguments, check=False).returncode == status
        command = [tmp_path / ".venv" / "bin" / "vehiclemor"]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    assert call("tests") == "command of tests\n"
    assert call("bench") == "command of bench\n"
    assert call("tests") == "command of bench\n"

"""What is refused, in one clear line."""

from collections.abc import Callable
from typing import Any

import pytest

from vehiclemor.exceptions import VehiclemorError


def refused(
    call: Callable[[], Any], *words: str, error: type[VehiclemorError] = VehiclemorError
) -> str:
    """The line of the error that a call must raise, with these words in it."""
    with pytest.raises(error) as caught:
        call()
    line = str(caught.value)
    assert line.isprintable()
    assert len(line) < 600
    for word in words:
        assert word in line, line
    return line

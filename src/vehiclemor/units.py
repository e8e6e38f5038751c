"""SI units, as their names say, in powers of the base units."""

import re

# Unit -> powers of base units.
DERIVED = {
    **{name: {name: 1} for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
}


def base_units(unit: str) -> dict[str, int] | None:
    """Powers of base units in a unit such as `N s/m` or `m s-1`; none where a name is unknown."""
    powers: dict[str, int] = {}
    numerator, *denominators = unit.split("/")
    for sign, part in ((1, numerator), *((-1, part) for part in denominators)):
        for factor in part.split():
            match = re.fullmatch(r"([A-Za-z]+)(?:\^?(-?\d+))?", factor)
            if factor == "1":
                continue
            if match is None or match[1] not in DERIVED:
                return None
            for base, power in DERIVED[match[1]].items():
                powers[base] = powers.get(base, 0) + sign * power * int(match[2] or 1)
    return powers

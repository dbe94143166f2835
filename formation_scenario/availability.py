"""Values of scenario keys that are defined, but not available in this version."""

from __future__ import annotations

from collections.abc import Iterator

from formation_scenario.errors import Problem
from formation_scenario.source import KeyPath, Plain, Source

EACH = "*"
NOT_AVAILABLE: dict[tuple[str, ...], tuple[str, ...]] = {
    ("vehicles", EACH, "autopilot"): ("arducopter",),
    ("vehicles", "autopilot"): ("arducopter",),
}
AVAILABLE: dict[str, str] = {
    "autopilot": "emulator, arduplane, px4",
}


def unavailable(source: Source) -> dict[KeyPath, Problem]:
    """Return the problem at every key whose value isn't available in this version."""
    return {
        path: source.problem(path, f"found '{value}', not available in this version", AVAILABLE[pattern[-1]])
        for pattern, values in NOT_AVAILABLE.items()
        for path, value in _matches(source.data, pattern)
        if value in values
    }


def _matches(data: Plain, pattern: tuple[str, ...], above: KeyPath = ()) -> Iterator[tuple[KeyPath, Plain]]:
    if not pattern:
        yield above, data
    elif pattern[0] == EACH and isinstance(data, list):
        for index, item in enumerate(data):
            yield from _matches(item, pattern[1:], (*above, index))
    elif isinstance(data, dict) and pattern[0] in data:
        yield from _matches(data[pattern[0]], pattern[1:], (*above, pattern[0]))

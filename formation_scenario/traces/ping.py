"""The output of `ping`: of Linux (with -D and -O), macOS, BusyBox and Windows."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

from formation_scenario.traces.recorded import Sample

REPLY: Final = r"(?:bytes from|Reply from|bytes=).*?time\s*([=<])\s*([\d.]+)\s*ms"
NUMBER: Final = r"\b(?:icmp_)?seq[=\s]+(\d+)"
STAMP: Final = r"^\s*\[(\d+\.\d+)\]"
LOST: Final = r"no answer yet|request timeout|request timed out|unreachable|ttl expired"
SUMMARY: Final = r"(\d+) packets transmitted.*?time (\d+)\s*ms"
COPY: Final = "(DUP!)"
WRAP: Final = 65536
"""Of ping's numbers."""
USUAL_S: Final = 1.0
"""Time between two requests unless -i says otherwise."""


def is_ping(lines: Sequence[str]) -> bool:
    """Return whether lines are ping's output: an answer, or the heading and no answers."""
    return any(re.search(REPLY, line, re.IGNORECASE) for line in lines) or any(
        line.startswith("PING ") for line in lines[:3]
    )


def read_ping(lines: Sequence[str], period_s: float | None) -> list[Sample]:
    """Return what ping measured, in the order of its requests; requests without an answer are lost.

    `period_s`: time between two requests; None: by the time stamps of -D, else by the summary, else 1 s.
    """
    delays_ms, stamps_s, line_of = dict[int, float](), dict[int, float](), dict[int, int]()
    summary: tuple[int, float] | None = None
    number = -1
    for line, text in enumerate(lines, start=1):
        if (sent := re.search(SUMMARY, text, re.IGNORECASE)) is not None:
            summary = int(sent[1]), float(sent[2]) / 1e3
        answer, lost = re.search(REPLY, text, re.IGNORECASE), re.search(LOST, text, re.IGNORECASE)
        if (answer is None and lost is None) or COPY in text:
            continue
        given = re.search(NUMBER, text, re.IGNORECASE)
        number = number + 1 if given is None else _unwrapped(int(given[1]), number)
        line_of.setdefault(number, line)
        if answer is not None and math.isnan(delays_ms.get(number, math.nan)):
            delays_ms[number] = float(answer[2]) / (2.0 if answer[1] == "<" else 1.0)
            stamp = re.match(STAMP, text)
            if stamp is not None:
                stamps_s[number] = float(stamp[1]) - delays_ms[number] / 1e3
        else:
            delays_ms.setdefault(number, math.nan)
    return _numbered(delays_ms, line_of, period_s or _period_s(stamps_s, summary))


def _unwrapped(number: int, last: int) -> int:
    """Return a request's number, counted on where ping begins again at 0."""
    rounds = max(last, 0) // WRAP
    found = number + rounds * WRAP
    return found + WRAP if last - found > WRAP // 2 else found


def _numbered(delays_ms: dict[int, float], line_of: dict[int, int], period_s: float) -> list[Sample]:
    if not delays_ms:
        return []
    first, found = min(delays_ms), list[Sample]()
    for number in range(first, max(delays_ms) + 1):
        line = line_of.get(number, 0)
        found.append(Sample(line, (number - first) * period_s, delays_ms.get(number, math.nan)))
    return found


def _period_s(stamps_s: dict[int, float], summary: tuple[int, float] | None) -> float:
    first, last = min(stamps_s, default=0), max(stamps_s, default=0)
    if last > first and stamps_s[last] > stamps_s[first]:
        return (stamps_s[last] - stamps_s[first]) / (last - first)
    if summary is not None and summary[0] > 1 and summary[1] > 0.0:
        return summary[1] / (summary[0] - 1)
    return USUAL_S

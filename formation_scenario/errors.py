"""Problems of a scenario, in the user's terms."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem of a scenario.

    `file` is the scenario's file or the override that it came from, None for a mapping; `line` and `column` count from
    1. `found` is a phrase ("found 'diamnd'"), and `allowed` says what is allowed instead.
    """

    file: str | None
    line: int | None
    column: int | None
    key: str
    found: str
    allowed: str = ""

    def __str__(self) -> str:
        """Return `file:line:column: key: found; allowed: ...`, without the parts that aren't known."""
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        what = f"{self.found}; allowed: {self.allowed}" if self.allowed else self.found
        return ": ".join(part for part in (place, self.key, what) if part)


class ScenarioError(Exception):
    """A scenario that can't be flown as written; `problems` has everything that was found wrong."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        """Take all problems at once; the message has one line for each, in the order of the file's lines."""
        files = list(dict.fromkeys(problem.file for problem in problems))
        self.problems = tuple(
            sorted(problems, key=lambda each: (files.index(each.file), each.line or 0, each.column or 0))
        )
        super().__init__("\n".join(str(problem) for problem in self.problems))


class FileError(Exception):
    """A file that a key names can't be used; the message says what was found, and where."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" for the choice nearest to a word, "" when none is near.

    A choice that is the word with a unit (`speed_mps` for `speed`) takes precedence.
    """
    known = list(choices)
    with_unit = [choice for choice in known if choice.startswith(f"{word}_")]
    near = with_unit or difflib.get_close_matches(word, known, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""

"""The laws that can be compared: names, and what each sets in a scenario."""

from __future__ import annotations

from formation_scenario import Problem, ScenarioError
from formation_scenario.errors import did_you_mean

COMPENSATED = "law.delay_compensation=true"
UNCOMPENSATED = "law.delay_compensation=false"
PID = "law.type=pid"
PRINTED = ("law.type=fuzzy_pid", "law.fuzzy.tables=printed")
SYMMETRIC = ("law.type=fuzzy_pid", "law.fuzzy.tables=symmetric")
CONSENSUS = "law.type=consensus"

LAWS: dict[str, tuple[str, ...]] = {
    "pid": (PID, COMPENSATED),
    "pid_uncompensated": (PID, UNCOMPENSATED),
    "fuzzy_pid": (*PRINTED, COMPENSATED),
    "fuzzy_pid_uncompensated": (*PRINTED, UNCOMPENSATED),
    "fuzzy_pid_symmetric": (*SYMMETRIC, COMPENSATED),
    "fuzzy_pid_symmetric_uncompensated": (*SYMMETRIC, UNCOMPENSATED),
    "consensus": (CONSENSUS, COMPENSATED),
    "consensus_uncompensated": (CONSENSUS, UNCOMPENSATED),
}
"""Overrides in the manner of `--set`; gains stay the scenario's, and the consensus law has its own."""


def named_laws(names: str) -> tuple[str, ...]:
    """Return the laws of a list like "pid,fuzzy_pid", each once.

    Raises:
        ScenarioError: a name isn't one of `LAWS`.
    """
    found = tuple(dict.fromkeys(name.strip() for name in names.split(",")))
    unknown = [name for name in found if name not in LAWS]
    if unknown:
        allowed = ", ".join(LAWS)
        problems = [
            Problem("--laws", None, None, "", f"found '{name}'{did_you_mean(name, LAWS)}", allowed) for name in unknown
        ]
        raise ScenarioError(problems)
    return found

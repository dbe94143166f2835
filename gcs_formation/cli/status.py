"""What a command ends with: a word on standard error, and a status that scripts rely on."""

from __future__ import annotations

import sys
from enum import IntEnum
from pathlib import Path
from typing import NoReturn

import click

from formation_scenario import Scenario, ScenarioError, load_scenario


class Status(IntEnum):
    """Exit statuses."""

    FINE = 0
    EXPECTATION_BROKEN = 1
    BAD_USAGE = 2
    COULD_NOT_GO_ON = 3
    INTERRUPTED = 130


def load(scenario: Path, overrides: tuple[str, ...]) -> Scenario:
    """Return a scenario, or end with what's wrong in it."""
    try:
        return load_scenario(scenario, overrides)
    except ScenarioError as error:
        fail(str(error), Status.BAD_USAGE)


def say(text: str, status: Status) -> Status:
    """Say it; return the status."""
    click.echo(text, err=True)
    return status


def fail(text: str, status: Status) -> NoReturn:
    """Say it, and end."""
    sys.exit(say(text, status))

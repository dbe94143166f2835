"""What a command ends with: a word on standard error, and a status that scripts rely on."""

from __future__ import annotations

import sys
from enum import IntEnum
from typing import NoReturn

import click


class Status(IntEnum):
    """Exit statuses."""

    FINE = 0
    EXPECTATION_BROKEN = 1
    BAD_USAGE = 2
    COULD_NOT_GO_ON = 3
    INTERRUPTED = 130


def say(text: str, status: Status) -> Status:
    """Say it; return the status."""
    click.echo(text, err=True)
    return status


def fail(text: str, status: Status = Status.BAD_USAGE) -> NoReturn:
    """Say it, and end."""
    sys.exit(say(text, status))

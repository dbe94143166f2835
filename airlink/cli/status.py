"""How a command ends: a message on standard error, and an exit status that scripts rely on."""

from __future__ import annotations

import sys
from enum import IntEnum
from typing import NoReturn

import click


class Status(IntEnum):
    """Exit statuses of all commands."""

    FINE = 0
    EXPECTATION_BROKEN = 1
    BAD_USAGE = 2
    COULD_NOT_GO_ON = 3
    INTERRUPTED = 130


def say(text: str, status: Status) -> Status:
    """Print a message to standard error; return the status."""
    click.echo(text, err=True)
    return status


def fail(text: str, status: Status = Status.BAD_USAGE) -> NoReturn:
    """Print a message to standard error and exit."""
    sys.exit(say(text, status))

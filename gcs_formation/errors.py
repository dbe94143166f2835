"""Errors of the ground station."""


class StationError(Exception):
    """Root of the ground station's errors; the message says what was found and what is allowed."""


class RunAbortedError(StationError):
    """The run could not go on: a port is taken, no vehicle answered, a vehicle refused."""


class RecordingError(RunAbortedError):
    """The record can't be written any more, usually because the disk is full."""


class NothingRunningError(StationError):
    """No running flight answers in a run directory."""


class RecordError(StationError):
    """A run directory that can't be written, or isn't one."""

"""Errors of the emulated vehicles."""


class SimVehiclesError(Exception):
    """Root of what the emulated vehicles raise."""


class TruthError(SimVehiclesError):
    """A file that isn't a record of ground truth."""

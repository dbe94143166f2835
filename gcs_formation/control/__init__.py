"""From present states to setpoints: mixer, fuzzy scheduler, PID, envelope. Pure functions on arrays."""

from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler

__all__ = ["FuzzyGainScheduler"]

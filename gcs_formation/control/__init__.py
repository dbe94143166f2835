"""From present states to setpoints: mixer, fuzzy scheduler, PID, envelope. Pure functions on arrays."""

from gcs_formation.control.fuzzy import FuzzyGainScheduler

__all__ = ["FuzzyGainScheduler"]

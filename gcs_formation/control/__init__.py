"""From vehicle states to setpoints: mixer, fuzzy scheduler, PID, envelope, and the formation laws built from them."""

from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler

__all__ = ["FuzzyGainScheduler"]

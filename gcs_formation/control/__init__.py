"""From present states to setpoints: mixer, fuzzy scheduler, PID, envelope, and the laws made of them."""

from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler

__all__ = ["FuzzyGainScheduler"]

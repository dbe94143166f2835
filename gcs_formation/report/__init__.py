"""Reports: figures and pages of recorded runs."""

from gcs_formation.report.reading import load_run
from gcs_formation.report.run_data import RunData

__all__ = ["RunData", "load_run"]

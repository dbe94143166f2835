"""Figures and one self-contained page of a finished run."""

from gcs_formation.report.page import write_report

__all__ = ["write_report"]

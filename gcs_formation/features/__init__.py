"""Features of the ground station, one folder each (`gcs_formation/core/feature.py`)."""

"""Estimates of the vehicles' present states from delayed telemetry."""

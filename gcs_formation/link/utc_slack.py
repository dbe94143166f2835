"""How exact a vehicle's UTC must be."""

from __future__ import annotations

from typing import Final

UTC_SLACK_S: Final = 5e-3
"""How far UTC may be outside the bounds of causality: the errors of stamps and round trips. Tuned: s; 2e-3 to 10e-3;
shown by `python -m benchmarks.gnss_grid`."""

"""Fixtures of keys and of whole flights, for the tests of features."""

from tests.flights.conftest import fly, kept_truth
from tests.formation_scenario.conftest import load, refusal

__all__ = ["fly", "kept_truth", "load", "refusal"]

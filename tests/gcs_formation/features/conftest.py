"""Fixtures of keys and of whole flights, for the tests of features."""

from tests.flights.conftest import fly
from tests.formation_scenario.conftest import load, refusal

__all__ = ["fly", "load", "refusal"]

"""Fixtures of whole flights, for the tests of features."""

from tests.flights.conftest import fly

__all__ = ["fly"]

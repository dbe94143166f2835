"""Checks parameters and positions of vehicles before the first command."""

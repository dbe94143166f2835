"""Deterministic simulation testing: seeded random flights, held against what must be so in every flight."""

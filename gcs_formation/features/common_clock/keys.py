"""The word by which a scenario asks for a common clock."""

from __future__ import annotations

from typing import Final

WORDS: Final = {"telemetry.clock": ("gnss",)}

"""A recorder: every tick and every event as a line of JSON, in a file of its own."""

import json
import math
from pathlib import Path
from typing import TextIO

from pydantic import BaseModel

from gcs_formation.extend import Cycle, Event, Recorder, register_recorder


@register_recorder("lines")  # extensions: {lines: {file: positions.jsonl}}
class Lines(Recorder):
    """Writes into the run directory; a socket, an MCAP file or a ROS 2 topic is opened in the same place."""

    class Keys(BaseModel):
        """`extensions.lines`."""

        file: str = "positions.jsonl"

    _file: TextIO

    def open(self, directory: Path) -> None:
        """Open the file."""
        self._file = (directory / self.keys.file).open("w", encoding="utf-8")

    def tick(self, cycle: Cycle) -> None:
        """Write where the vehicles are."""
        places = {str(each.id): each.state[:3] for each in cycle.every_vehicle if math.isfinite(each.state.north_m)}
        self._file.write(json.dumps({"t_s": cycle.time_s, "phase": cycle.phase, "vehicles": places}) + "\n")

    def event(self, event: Event) -> None:
        """Write what happened."""
        self._file.write(json.dumps({"kind": event.kind, "text": event.text}) + "\n")

    def close(self) -> None:
        """Close the file."""
        self._file.close()

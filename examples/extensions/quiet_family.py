"""An emulated family: an ArduPlane of another version that reports its mission to the operator."""

from pydantic import BaseModel, Field

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from gcs_formation.extend import register_emulated_family
from sim_vehicles.families import Plane


@register_emulated_family("quiet")  # vehicles: [{id: 3, emulator: {family: quiet, parameters: {every_s: 20}}}]
class QuietPlane(Plane):
    """Answers like an ArduPlane; what it overrides is its own."""

    version = 4 << 24 | 8 << 16

    class Keys(BaseModel):
        """`parameters` beside `family`."""

        text: str = "on my way"
        every_s: float = Field(default=5.0, gt=0.0)

    _next: Instant = NEVER

    def forget(self) -> None:
        """Begin to count at boot."""
        super().forget()
        self._next = self.now

    def follow_time(self) -> None:
        """Do what is due in each cycle of the main loop."""
        super().follow_time()
        if self.now >= self._next:
            self._next = after(self.now, self.keys.every_s)
            self.say(m.MAV_SEVERITY_INFO, self.keys.text)

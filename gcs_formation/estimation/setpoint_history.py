"""The present state from a delayed one: the autopilot model (7) run through the setpoints still in flight."""

from __future__ import annotations

from airlink.clock import NANOSECONDS
from flight_model.autopilot import AutopilotModel, FlightState, advance, respond, within
from flight_model.slot import NOTHING, Triple

HISTORY_S = 6.0


class SentSetpoints:
    """One tick's setpoints, vehicle by vehicle, and when each is expected to act, in ns."""

    __slots__ = ("acts", "setpoints")

    def __init__(self, acts: list[int]) -> None:
        """Begin with none known."""
        self.acts = acts
        self.setpoints: list[Triple] = [NOTHING] * len(acts)


class SetpointHistory:
    """The setpoints sent to every vehicle in the last seconds, oldest first."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of ticks at `rate_hz`."""
        self.length = max(8, int(HISTORY_S * rate_hz))
        self._ticks: list[SentSetpoints] = []

    @property
    def empty(self) -> bool:
        """Whether nothing has been sent yet."""
        return not self._ticks

    def begin(self, acts: list[int]) -> None:
        """Begin a tick whose setpoints act at `acts`, (V,); until they are known, vehicles fly straight on then."""
        if len(self._ticks) == self.length:
            del self._ticks[0]
        self._ticks.append(SentSetpoints(acts))

    def note(self, setpoints: list[Triple]) -> None:
        """Take the setpoints of the tick that was begun last, (V,), NaN for those that aren't known yet."""
        self._ticks[-1].setpoints = setpoints.copy()

    def carry(
        self, state: FlightState, since: int, until: int, vehicle: int, model: AutopilotModel, *, place: bool = True
    ) -> None:
        """Move a vehicle's `state` on from `since` to `until`, instants in ns, through what it was sent.

        Before the oldest known setpoint it is taken to follow that one already, and without any setpoint to fly
        straight on. Without `place`, north and east are left as they are.
        """
        ticks, last = self._ticks, len(self._ticks) - 1
        first = self._acting(since, vehicle)
        for index in range(first, last + 1):
            tick, end = ticks[index], until
            if index < last:
                end = min(max(ticks[index + 1].acts[vehicle], since), until)
            if end > since:
                speed_mps, heading_rad, height_m = tick.setpoints[vehicle]
                speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
                if place:
                    advance(state, model, speed_mps, heading_rad, height_m, (end - since) / NANOSECONDS)
                else:
                    respond(state, model, speed_mps, heading_rad, height_m, (end - since) / NANOSECONDS)
                since = end

    def _acting(self, instant: int, vehicle: int) -> int:
        """Return the place of a vehicle's newest setpoint that acts at an instant; the oldest if none does yet."""
        index = len(self._ticks) - 1
        while index > 0 and self._ticks[index].acts[vehicle] > instant:
            index -= 1
        return index

    def commanded(self, instant: int, vehicle: int) -> Triple:
        """Return a vehicle's newest setpoint that acts at an instant, or the oldest one if none does yet."""
        return self._ticks[self._acting(instant, vehicle)].setpoints[vehicle]

    def between(self, since: list[int], until: list[int]) -> list[SentSetpoints]:
        """Return the ticks by whose setpoints any vehicle flew from `since` to `until`, instants of each vehicle."""
        first = min(self._acting(begin, vehicle) for vehicle, begin in enumerate(since))
        last = max(self._acting(end - 1, vehicle) for vehicle, end in enumerate(until))
        return self._ticks[first : max(first, last) + 1]

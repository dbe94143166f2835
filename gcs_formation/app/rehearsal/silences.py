"""How long losses in bursts silence uplinks: the links' channels alone, with as many datagrams as a flight sends.

A vehicle that receives nothing for long flies on by its last setpoint, can't evade, and has to come back. Such silences
are rare, so that a stretch of a flight needn't show one; a channel alone passes a whole flight's datagrams in its time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from airlink.clock import Instant, after, seconds_between
from airlink.impairment import Direction
from airlink.one_way_channel import Channel
from airlink.random_streams import random_stream
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario import Scenario, Vehicle
from formation_scenario.planned_progress import planned_end_s
from gcs_formation.app.link_injection import LinkSchedule
from gcs_formation.fleet.heartbeats import HEARTBEAT_S, PROBE_S
from gcs_formation.fleet.membership import SUCCESSION_S
from gcs_formation.from_scenario import autopilot_for
from gcs_formation.phases import Flight, Phase

BURSTS_HZ: Final = 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0
"""Values of law.rate_hz that are tried where silences last too long."""
FRAME_BYTES: Final = 50
"""Size of a datagram; only links with a rate ask for it."""


class Silences(NamedTuple):
    """The silences of uplinks, each longer than `SUCCESSION_S`."""

    number: int
    longest_s: float
    flown_s: float
    """Time for which the links' channels were flown, s."""
    enough_hz: float | None
    """The rate of the law from which on there was none; None if none was looked for, or found."""

    def __str__(self) -> str:
        """Return it in words."""
        silent = f"{self.number} silences of more than {SUCCESSION_S:g} s" if self.number else "no long silence"
        longest = f", the longest of {self.longest_s:.1f} s" if self.number else ""
        return f"{silent} in {self.flown_s:.0f} s{longest}"


def silences(scenario: Scenario, over: Callable[[], bool]) -> Silences | None:
    """Return the silences of a flight's uplinks, as far as they are known before time is `over`; None without loss."""
    lossy = [each for each in scenario.vehicles if any(step.uplink.loss > 0.0 for step in scenario.link_steps(each))]
    if not lossy:
        return None
    found = _flown(scenario, lossy, scenario.law.rate_hz, over)
    higher = (each for each in BURSTS_HZ if each > scenario.law.rate_hz)
    if not found.number:
        return found
    enough = (each for each in higher if not over() and not _flown(scenario, lossy, each, over).number)
    return found._replace(enough_hz=next(enough, None))


def long_silences(found: Silences) -> str | None:
    """Return what silences do to vehicles, and which rate of the law has fewer; None if there was none."""
    if not found.number:
        return None
    slower = "" if found.enough_hz is None else f"; law.rate_hz of {found.enough_hz:g} or more makes that rare"
    return (
        f"links: losses come in bursts that silence some vehicle's uplink for over {SUCCESSION_S:g} s, {found.number} "
        f"times in {found.flown_s:.0f} s and for up to {found.longest_s:.1f} s: it flies on as it was commanded last, "
        f"and can't evade{slower}"
    )


def _flown(scenario: Scenario, lossy: list[Vehicle], rate_hz: float, over: Callable[[], bool]) -> Silences:
    flight = Flight(Phase.FLYING, path_began=Instant(0))
    schedule, end_s = LinkSchedule(scenario, flight), planned_end_s(scenario)
    each, flown_s = list[float](), end_s
    for vehicle in lossy:
        gaps_s, until_s = _gaps_s(scenario, schedule, vehicle, _sent_hz(scenario, vehicle, rate_hz), over)
        each += gaps_s
        flown_s = min(flown_s, until_s)
    return Silences(len(each), max(each, default=0.0), flown_s, None)


def _gaps_s(
    scenario: Scenario, schedule: LinkSchedule, vehicle: Vehicle, sent_hz: float, over: Callable[[], bool]
) -> tuple[list[float], float]:
    """Return how long each silence of one uplink lasts, and for how long it was flown."""
    channel, end_s = Channel(random_stream(scenario.seed, "rehearsal", *vehicle.vehicle_id)), planned_end_s(scenario)
    found, last, now, index = list[float](), Instant(0), Instant(0), 0
    while (now_s := index / sent_hz) < end_s and (index % 256 or not over()):
        now, index = after(Instant(0), now_s), index + 1
        impairment = schedule.both_directions(vehicle.vehicle_id, now)[Direction.UPLINK]
        if impairment.outage:  # planned, and said by others
            last = now
        elif channel.pass_on(FRAME_BYTES, now, impairment):
            if (silent_s := seconds_between(last, now)) > SUCCESSION_S:
                found.append(silent_s)
            last = now
    if (silent_s := seconds_between(last, now)) > SUCCESSION_S:
        found.append(silent_s)
    return found, now_s


def _sent_hz(scenario: Scenario, vehicle: Vehicle, rate_hz: float) -> float:
    """Return how many datagrams go up to a vehicle a second at a rate of the law."""
    setpoints = autopilot_for(vehicle, scenario).setpoint(Setpoint(0.0, 0.0, 0.0), FlightState(*[0.0] * 8))
    return 1.0 / PROBE_S + 1.0 / HEARTBEAT_S + len(setpoints) * rate_hz

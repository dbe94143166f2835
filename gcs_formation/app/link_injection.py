"""What a scenario injects: link impairments around the station, their realised delays, and faults as events."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.impaired_link import ImpairedEngine, LinkId
from airlink.impairment import UNIMPAIRED, Direction, Impairment, together
from airlink.one_way_channel import ChannelStatistics
from airlink.trace import Trace
from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.fields import refused
from formation_scenario.links import Impairment as PlannedImpairment
from formation_scenario.links import LinkStep, min_mean_burst
from formation_scenario.scripted import ScriptedLink, impaired
from formation_scenario.traces.keys import Trace as RecordedTrace
from gcs_formation.app.link_processes import LinkProcesses
from gcs_formation.app.shared_radios import radios_of
from gcs_formation.phases import Flight
from gcs_formation.recorder import Event, Recorder
from gcs_formation.station import Station

Both = tuple[Impairment, Impairment]
Steps = tuple[LinkStep, ...]


class InjectedFaults:
    """Records each fault when it's due by mission time. The station doesn't know: it has to notice."""

    def __init__(self, scenario: Scenario, recorder: Recorder) -> None:
        self._recorder = recorder
        self._pending = deque(sorted(_planned(scenario)))

    @property
    def pending(self) -> bool:
        """Whether any is still to come."""
        return bool(self._pending)

    def record_due(self, flight: Flight, now: Instant) -> None:
        """Record what has become due."""
        while self._pending and self._pending[0][0] <= flight.mission_time_s(now):
            _, vehicle, kind, ends = self._pending.popleft()
            text = f"{kind} is over" if ends else kind
            self._recorder.event(Event(now, "fault", text, vehicle, {"fault": kind, "ends": ends}))


def _planned(scenario: Scenario) -> Iterator[tuple[float, VehicleId, str, bool]]:
    """Yield when each fault begins or ends, on which vehicle, its kind, and whether it ends."""
    for fault in scenario.faults:
        for vehicle in scenario.selected(fault.vehicles):
            yield from ((at_s, vehicle.vehicle_id, fault.kind, ends) for at_s, ends in fault.moments())


def planned_end_s(scenario: Scenario, vehicle: VehicleId, ended_s: float) -> float:
    """Return the mission time from which a fault silenced a vehicle until the flight ended; infinity if none did.

    `ended_s`: mission time of the end, NaN if the flight ended before the path.
    """
    ends_s = math.inf
    for fault in scenario.faults:
        chosen = any(each.vehicle_id == vehicle for each in scenario.selected(fault.vehicles))
        over = fault.end_s <= ended_s
        if chosen and scenario.silences(fault) and fault.at_s <= ended_s and not over:
            ends_s = min(ends_s, fault.at_s)
    return ends_s


class LinkSchedule:
    """The impairments of every link: as the scenario plans them, with what a program has changed since."""

    def __init__(self, scenario: Scenario, flight: Flight) -> None:
        """Links change with the mission time of `flight`; before t = 0 they are as at t = 0."""
        self._scenario, self._flight, self.seed = scenario, flight, scenario.seed
        self.radios = radios_of(scenario)
        self.processes = LinkProcesses(scenario)
        self._steps: dict[LinkId, Steps] = {
            (vehicle.vehicle_id, number): scenario.own_link_steps(vehicle, number)
            for vehicle, number in scenario.each_link()
        }
        self._known = Translations(scenario, self.processes)
        self._links = dict[LinkId, Translated]()
        self._first = dict[VehicleId, Translated]()
        """Those of first links, which most vehicles have alone."""
        self.clear = True
        """Whether no link has been, is or will be impaired."""
        self._translate()

    def both_directions(self, vehicle: VehicleId, now: Instant, number: int = 1) -> Both:
        """Return the impairments of the uplink and the downlink of a vehicle's link."""
        links = self._first.get(vehicle) if number == 1 else self._links.get((vehicle, number))
        if links is None:
            return UNIMPAIRED, UNIMPAIRED
        if not links.times_s:
            return links.impairments[0]
        mission_s = self._flight.mission_time_s(now)
        return links.impairments[0 if math.isnan(mission_s) else bisect_right(links.times_s, mission_s)]

    def change(self, change: ScriptedLink) -> bool:
        """Change links from now on; the keys that change stay so, whatever the scenario plans for later.

        Return whether any is not as it was.

        Raises:
            ScenarioError: losses come in bursts that are too short for their share.
        """
        became = dict[Steps, Steps]()  # vehicles whose links change alike share their steps
        vehicles = {each.vehicle_id for each in self._scenario.selected(change.vehicles)}
        selected = [each for each in self._steps if each[0] in vehicles and change.link in (None, each[1])]
        for link in selected:
            steps = self._steps[link]
            if steps not in became:
                became[steps] = _changed(steps, change)
                _require_bursts(link[0], became[steps])
        for link in selected:
            self._steps[link] = became[self._steps[link]]
        self._translate()
        return any(was != now for was, now in became.items())

    def _translate(self) -> None:
        self._links = self._known.of(self._steps)
        self._first = {vehicle: links for (vehicle, number), links in self._links.items() if number == 1}
        distinct = {id(links): links for links in self._links.values()}.values()
        self.clear = self.clear and all(
            one.transparent for links in distinct for both in links.impairments for one in both
        )


class Translated:
    """A link's impairments, and the mission times from which the second and later ones hold."""

    def __init__(self, times_s: list[float], impairments: list[Both]) -> None:
        self.times_s, self.impairments = times_s, impairments


class Translations:
    """Translates links' steps, each distinct sequence of them once; recorded delays, too.

    A link with a process of an extension has an instance of its own, and shares nothing.
    """

    def __init__(self, scenario: Scenario, processes: LinkProcesses) -> None:
        """Start with none of `scenario`'s; `processes` makes those of extensions."""
        self._scenario, self._processes = scenario, processes
        self._links = dict[tuple[Steps, LinkId | None], Translated]()
        self._traces = dict[RecordedTrace, Trace]()

    def of(self, steps_of: Mapping[LinkId, Steps]) -> dict[LinkId, Translated]:
        """Return each translated link; links with the same steps share one, others are forgotten."""
        known = dict[tuple[Steps, LinkId | None], Translated]()
        found = dict[LinkId, Translated]()
        for link, steps in steps_of.items():
            key = steps, link if any(step.uplink.process or step.downlink.process for step in steps) else None
            if key not in known:
                known[key] = self._links[key] if key in self._links else self._translated(link, steps)
            found[link] = known[key]
        self._links = known
        return found

    def _translated(self, link: LinkId, steps: Steps) -> Translated:
        up, down = Direction.UPLINK, Direction.DOWNLINK
        impairments = [
            (self._impairment(link, up, step.uplink), self._impairment(link, down, step.downlink)) for step in steps
        ]
        return Translated([step.at_s for step in steps[1:]], impairments)

    def _impairment(self, link: LinkId, direction: Direction, planned: PlannedImpairment) -> Impairment:
        process, recording = self._processes.of(link[0], direction, planned, link[1]), planned.recording
        if recording is not None:
            process = together(self._trace(recording), process)
        return Impairment(
            delay_s=planned.delay_ms / 1e3,
            jitter_s=planned.jitter_ms / 1e3 if recording is None else 0.0,
            distribution=planned.distribution,
            loss=planned.loss,
            mean_burst=planned.mean_burst,
            duplicate=planned.duplicate,
            rate_bps=planned.rate_kbps * 1e3,
            queue_s=planned.queue_ms / 1e3,
            reorder=planned.reorder,
            outage=planned.outage,
            process=process,
        )

    def _trace(self, recording: RecordedTrace) -> Trace:
        if recording not in self._traces:
            found = self._scenario.recorded_delays(recording)
            delays_s = [each / 1e3 for each in found.delays_ms]
            drawn, begin_s = recording.between == "drawn", recording.begin_s
            self._traces[recording] = Trace(
                found.times_s, delays_s, found.period_s, gaps=found.gaps, begin_s=begin_s, drawn=drawn
            )
        return self._traces[recording]


def _changed(steps: Steps, change: ScriptedLink) -> Steps:
    return tuple(
        LinkStep(
            step.at_s, impaired(step.uplink, change, change.uplink), impaired(step.downlink, change, change.downlink)
        )
        for step in steps
    )


def _require_bursts(vehicle: VehicleId, steps: Steps) -> None:
    for step in steps:
        _require_burst(vehicle, step.uplink)
        _require_burst(vehicle, step.downlink)


def _require_burst(vehicle: VehicleId, link: PlannedImpairment) -> None:
    minimum = min_mean_burst(link.loss)
    if link.mean_burst is not None and link.mean_burst < minimum:
        found = f"found {link.mean_burst:g} with a loss of {link.loss:g} (vehicle {vehicle})"
        raise refused("mean_burst", found, f"{minimum:g} or more with that loss")


def impair(scenario: Scenario, station: Station) -> ImpairedEngine | None:
    """Return the station wrapped in the scenario's links; None if these never impair anything."""
    return wrapped(station, LinkSchedule(scenario, station.flight))


def wrapped(station: Station, schedule: LinkSchedule) -> ImpairedEngine | None:
    """Return the station wrapped in links, which know whom it talks to; None if nothing impairs them."""
    if schedule.clear and not schedule.radios:
        return None
    each = [(identity, link) for identity, vehicle in station.vehicles.items() for link in vehicle.each_link]
    numbers = {(identity, link.connection.socket): link.number for identity, link in each if link.number > 1}
    schedules = schedule.both_directions, schedule.seed, schedule.radios, numbers, schedule.both_directions
    links = ImpairedEngine(station, station.networks, *schedules)
    for identity, link in each:
        if link.connection.peer is not None:
            links.expect(link.connection.socket, link.connection.peer, identity)
    return links


def injected(statistics: tuple[ChannelStatistics, ChannelStatistics]) -> tuple[float, float, float, float]:
    """Return a link's mean injected delays up and down so far, s (0 where nothing was sent), and its losses."""
    up, down = statistics
    up_s, down_s = (each.mean_delay_s if each.delivered else 0.0 for each in statistics)
    return up_s, down_s, up.loss, down.loss


class RecentDelay:
    """The delay of one direction: of what was sent since the last look, or else of what was sent last."""

    def __init__(self) -> None:
        """Start with nothing sent."""
        self._datagrams, self._delivered, self._total_s = 0, 0, 0.0
        self._mean_s = math.nan

    def look(self, statistics: ChannelStatistics) -> float:
        """Return the mean delay, s; NaN if everything sent was lost, or nothing was ever sent."""
        delivered, total_s = statistics.delivered - self._delivered, statistics.total_delay_s - self._total_s
        if statistics.datagrams != self._datagrams:
            self._mean_s = total_s / delivered if delivered else math.nan
        self._datagrams, self._delivered, self._total_s = (
            statistics.datagrams,
            statistics.delivered,
            statistics.total_delay_s,
        )
        return self._mean_s


class InjectedDelays:
    """Delays that were injected into each link, for every tick."""

    def __init__(
        self,
        vehicles: Iterable[VehicleId],
        links: ImpairedEngine | None,
        otherwise_s: float,
        in_use: Callable[[VehicleId], int] = lambda _: 1,
    ) -> None:
        """Read the statistics of `links`. Without links every delay is `otherwise_s`: 0, or NaN if not known.

        `in_use` returns the number of a vehicle's link in use.
        """
        self._in_use = in_use
        self._links, self._otherwise_s = links, otherwise_s
        self._delays = dict[LinkId, tuple[RecentDelay, RecentDelay]]()
        self._series_s = {vehicle: array("d") for vehicle in vehicles}
        self._ticks = 0

    def attach(self, links: ImpairedEngine) -> None:
        """Read the statistics of links that are impaired from now on."""
        self._links = links

    def record(self, ticks: int) -> None:
        """Record what was injected since the previous tick, once for every new tick; a tick may lack datagrams."""
        if ticks == self._ticks:
            return
        if self._links is not None:
            for vehicle, series_s in self._series_s.items():
                up_s, down_s = self._since_last_s(vehicle, self._links)
                for _ in range(ticks - self._ticks):
                    series_s.append(up_s)
                    series_s.append(down_s)
        self._ticks = ticks

    def series_s(self, ticks: int) -> Mapping[VehicleId, Array]:
        """Return each vehicle's mean delays up and down, s (T, 2); NaN where all was lost, or before a resumption.

        `ticks`: T, including those before a resumption.
        """
        series_s = {vehicle: np.full((ticks, 2), math.nan) for vehicle in self._series_s}
        for vehicle, each_s in series_s.items():
            known_s = np.array(self._series_s[vehicle]).reshape(-1, 2)
            each_s[ticks - self._ticks : ticks - len(known_s)] = self._otherwise_s
            each_s[ticks - len(known_s) :] = known_s
        return series_s

    def _since_last_s(self, vehicle: VehicleId, links: ImpairedEngine) -> tuple[float, float]:
        link = vehicle, self._in_use(vehicle)
        delays, (uplink, downlink) = self._delays.get(link), links.statistics(*link)
        if delays is None:
            delays = self._delays[link] = RecentDelay(), RecentDelay()
        return delays[0].look(uplink), delays[1].look(downlink)

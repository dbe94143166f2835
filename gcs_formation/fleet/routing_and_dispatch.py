"""Finds the sender of each frame (one of our vehicles, a stranger, our own echo), and schedules what is sent to whom.

Which of two remotes with a vehicle's system id is that vehicle is decided by `link.source_binding`. Heartbeats, mission
time and TIMESYNC have schedules of their own; setpoints are sent so that they take effect at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Set
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.endpoint import Address, ComponentId, VehicleId
from airlink.engine import Datagram, DelayQueue
from airlink.frame import Frame, ParserCounts
from airlink.messages import MISSION_TIME, Message
from airlink.messages.system import Heartbeat, NamedValueFloat
from flight_model.autopilot_model import Setpoint, finite
from flight_model.slot import Triple
from formation_scenario import Scenario
from formation_scenario.slot_assignment import column_models
from gcs_formation.link.link_health import STALE_AFTER_NS, LinkState
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.phases import Flight, Phase
from gcs_formation.recorder import GiveUp, Note, Tick, VehicleLink
from gcs_formation.vehicle.autopilot_family import STATION
from gcs_formation.vehicle.vehicle import Member, Vehicle

AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
NO_AUTOPILOT: Final = m.MAV_AUTOPILOT_INVALID
SYSTEMS: Final = 256
MANY_COPIES: Final = 20
"""Number of copies of a vehicle's frames after which they are reported."""
COPIES_TEXT: Final = "its frames come more than once, as by a second link; copies and what is overtaken are ignored"
IF_ONE: Final = "If it is one vehicle with two links, name both: endpoint: [A, B]"
HOLDS_OFF: Final = "its heartbeats hold off the vehicles' failsafe when ours stop (another id: station.system)"

EVERYONE = 0
"""MAVLink's broadcast id, which isn't allowed as a sender's id."""


TryPort = Callable[[Vehicle, int, Address, Instant], bool]


class Senders:
    """Finds the vehicle that sent a frame; reports each other sender once."""

    def __init__(
        self,
        vehicles: Mapping[VehicleId, Vehicle],
        networks: tuple[int, ...],
        flight: Flight,
        note: Note,
        give_up: GiveUp,
        station: ComponentId = STATION,
        try_port: TryPort | None = None,
    ) -> None:
        """Take the `vehicles`; `networks[s]` is the network of socket s; `station`: our own ids.

        `try_port`: tries a second sender as a further link of a vehicle.
        """
        self._try_port = try_port
        self._networks = networks
        self._vehicles: list[list[Vehicle | None]] = [[None] * SYSTEMS for _ in networks]
        """Vehicles by socket and system id."""
        for identity, vehicle in vehicles.items():
            for socket, network in enumerate(networks):
                if network == identity.network:
                    self._vehicles[socket][identity.system] = vehicle
        self._flight = flight
        self._note = note
        self._give_up = give_up
        self._station = station
        self._strangers: set[VehicleId] = set()
        self._namesakes: set[ComponentId] = set()
        """Other senders with our system id that have been reported."""
        self._all = list(vehicles.values())
        self._peers, self._peers_at = frozenset[Address](), NEVER

    def peers(self, tick: Instant) -> frozenset[Address]:
        """Return the vehicles' addresses, looked up once for each next tick."""
        if self._peers_at != tick:
            self._peers_at = tick
            connections = [link.connection for vehicle in self._all for link in vehicle.each_link]
            self._peers = frozenset(each.peer for each in connections if each.peer is not None)
        return self._peers

    def sender(self, frame: Frame, datagram: Datagram, now: Instant) -> Vehicle | None:
        """Return the vehicle whose autopilot sent a frame, None for another sender; its `history` tells news.

        One with several links is then seen by that on which the frame came.
        """
        socket, message = datagram.socket, frame.message
        vehicle = self._vehicles[socket][frame.system]
        if vehicle is None:
            self._note_stranger(VehicleId(self._networks[socket], frame.system), frame, datagram, now)
            return None
        if frame.component != AUTOPILOT or (isinstance(message, Heartbeat) and message.autopilot == NO_AUTOPILOT):
            return None  # from a device that isn't an autopilot, such as a companion computer
        if vehicle.links is not None:
            vehicle.see(vehicle.links.at(socket, datagram.peer))
        connection, history = vehicle.connection, vehicle.history
        bound = connection.state is not LinkState.SEARCHING
        elsewhere = bound and (socket != connection.socket or datagram.peer != connection.peer)
        silent = now - connection.last_heard >= STALE_AFTER_NS
        follows = vehicle.sequence.may_follow(frame.sequence, now, connection.last_heard)
        if history.is_copy(frame, now, elsewhere=elsewhere, follows=follows, silent=silent):
            if history.copies == MANY_COPIES:
                self._note(now, "copies", COPIES_TEXT, vehicle, {"peer": str(datagram.peer)})
            return vehicle
        if history.is_lost_one(frame, now, elsewhere=elsewhere):
            return None
        admitted, finding = vehicle.source_binding.judge(message, socket, datagram.peer, now)
        tried = not admitted and self._is_tried(vehicle, datagram, now) if finding is not None else False
        if finding is not None and not tried:
            self._note_finding(vehicle, finding, datagram, now, admitted=admitted)
        if not admitted:
            return None
        follows = follows or vehicle.sequence.is_near(frame.sequence)
        history.take(frame, now, follows=follows, awaited=vehicle.round_trips.awaits(message))
        return vehicle

    def _is_tried(self, vehicle: Vehicle, datagram: Datagram, now: Instant) -> bool:
        """Return whether another sender is tried as a further link: in flight, where positions tell vehicles apart."""
        if self._try_port is None or self._flight.phase is Phase.CONNECTING:
            return False
        return self._try_port(vehicle, datagram.socket, datagram.peer, now)

    def _note_finding(self, vehicle: Vehicle, text: str, datagram: Datagram, now: Instant, *, admitted: bool) -> None:
        self._note(now, "address" if admitted else "duplicate", text, vehicle, {"peer": str(datagram.peer)})
        if admitted:
            vehicle.sequence.restart()
            vehicle.history.restart()
        elif self._flight.phase is Phase.CONNECTING:
            self._give_up(f"vehicle {vehicle.identity}: {text}; allowed: each id once. {IF_ONE}", now)

    def _note_stranger(self, identity: VehicleId, frame: Frame, datagram: Datagram, now: Instant) -> None:
        if not isinstance(frame.message, Heartbeat):
            return
        details = {"peer": str(datagram.peer)}
        if identity.system == self._station.system:
            self._note_namesake(ComponentId(frame.system, frame.component), details, now)
        elif identity not in self._strangers:
            self._strangers.add(identity)
            why = (
                "is the broadcast address and no vehicle's id"
                if identity.system == EVERYONE
                else "isn't in the scenario"
            )
            self._note(now, "stranger", f"system {identity} is heard, but {why}", None, details)

    def _note_namesake(self, sender: ComponentId, details: dict[str, str], now: Instant) -> None:
        """Report a sender with our system id once, with what it means."""
        if sender in self._namesakes:
            return
        self._namesakes.add(sender)
        if sender == self._station:
            text = f"{sender} are our own ids: another ground station has them, or our own frames come back"
        else:
            text = f"another ground station, {sender}, has our system id"
        self._note(now, "own_id", f"{text}; {HOLDS_OFF}", None, dict(details))


FLOOD_BYTES_PER_S: Final = 100e3
"""Bytes that aren't frames or weren't read; a vehicle sends some 5 kB/s."""
FLOOD_FRAMES_PER_S: Final = 1000.0
"""Frames that aren't taken for a vehicle's."""
SUBSIDED: Final = 0.5
"""A flood is over below this share of both."""


class FloodWatch:
    """Reports when so much of others arrives that the sockets may lose frames of vehicles."""

    def __init__(self, note: Note) -> None:
        """Start without counts."""
        self._note, self._flooded, self._looked = note, False, NEVER
        self._garbage_bytes = self._unread_bytes = self._refused = 0
        self.unread_bytes = 0
        """Bytes of strangers that weren't read, so far."""

    def watch(self, now: Instant, counts: ParserCounts, frames_refused: int) -> None:
        """Compare the counts since the flight began with those of the last call."""
        garbage, refused = counts.garbage_bytes - self._garbage_bytes, frames_refused - self._refused
        unread = counts.unread_bytes - self._unread_bytes
        over_s = 0.0 if self._looked == NEVER else seconds_between(self._looked, now)
        self._garbage_bytes, self._unread_bytes = counts.garbage_bytes, counts.unread_bytes
        self._refused, self._looked = frames_refused, now
        if over_s <= 0.0:
            return
        share = max((garbage + unread) / over_s / FLOOD_BYTES_PER_S, refused / over_s / FLOOD_FRAMES_PER_S)
        if not self._flooded and share > 1.0:
            self._flooded = True
            junk = f"{garbage / over_s / 1e3:.0f} kB of no frame"
            if unread:
                junk += f", {unread / over_s / 1e3:.0f} kB of strangers, which aren't read,"
            what = f"{junk} and {refused / over_s:.0f} frames of others arrive"
            self._note(now, "flood", f"{what} a second; frames of vehicles may be lost in that", None, {})
        elif self._flooded and share < SUBSIDED:
            self._flooded = False
            self._note(now, "flood", "is over", None, {})


HOLD_MAX_S: Final = 1.0
"""Longest time for which the leader's setpoints are delayed."""
UNGUIDED_S: Final = 2.0
"""Longest lack of setpoints before heartbeats are withheld, so that the vehicle's failsafe acts."""
HEARTBEAT_S: Final = 1.0
HEARTBEAT: Final = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
PROBE_S: Final = 0.25
FAILOVER_PROBE_S: Final = 0.2
"""Period of requests on each of several links, by which one that dies is found within a second."""
GOLDEN: Final = (math.sqrt(5) - 1) / 2
OFTEN_PROBE_S: Final = 0.1
"""Period of requests to a vehicle whose clock is still uncertain by jitter: the uncertainty goes with its root."""
MAX_LOSS: Final = 0.02
"""With more loss the link may be full, and isn't loaded with more requests."""
SPREAD: Final = math.sqrt(2.0) - 1.0
PROBE_DITHER_S: Final = 0.02
"""Requests are spread over the period of a vehicle's main loop, so that the wait for it averages to half a period."""


class Dispatch:
    """Sends setpoints; the leader's are delayed so that they take effect with the slowest follower's."""

    def __init__(self, scenario: Scenario, vehicles: dict[VehicleId, Vehicle]) -> None:
        """Start without setpoints."""
        self._virtual_leader = scenario.leader is None
        self._compensates = scenario.law.delay_compensation
        self._count = 1 + len(scenario.followers)
        self._vehicles = list(vehicles.values())
        self._at_once: list[tuple[Vehicle, Message]] = []
        self._held = DelayQueue[tuple[Vehicle, Message]]()
        self.due = NEVER
        """When the next message is to be sent."""
        self._guided = [False] * self._count
        """Whether each column got a setpoint at this tick, (C,)."""
        self._without: list[Instant | None] = [None] * self._count
        """Since when a column that should get setpoints has had none, (C,)."""
        self._last_due = vec[i64]([0] * self._count)
        """When each column's newest setpoint is to be sent, (C,)."""
        self._dead_s = [each.dead_time_s for each in column_models(scenario)]
        """The autopilots' dead times, (C,)."""

    def links(self, leader: int, disobeying: list[bool], now: Instant) -> tuple[list[VehicleLink], float]:
        """Return every column's present link, and for how long setpoints of column `leader` are held back, s.

        `disobeying`: (C,) whether each vehicle seems not to fly as commanded.
        """
        links = [VehicleLink(now) for _ in self._guided]
        links[0].ready = self._virtual_leader
        for vehicle in self._vehicles:
            link, clock = links[vehicle.column], vehicle.clock
            link.ready = vehicle.member is Member.FLYING
            link.delay_s, link.asymmetry_s = clock.one_way_s, clock.asymmetry_s
            if vehicle.round_trips.knows_ways:
                link.up_s, link.down_s = vehicle.round_trips.up_down_s
            link.jitter_s = vehicle.jitter.jitter_s
            link.airborne, link.flew = vehicle.airborne, vehicle.flew
            may_loiter = vehicle.may_loiter
            if may_loiter or not link.ready:
                link.circling, link.flies_home_m = vehicle.circles, vehicle.flies_home_m
                link.holds_at_m = math.nan if vehicle.member is Member.PARTED else vehicle.holds_at_m
                if vehicle.autopilot.stands and vehicle.member is Member.HOLDING:
                    link.brakes = vehicle.holds_from
            link.heard = vehicle.round_trips.heard_at(now)
            link.dead_s = self._dead_s[vehicle.column]
            link.lag_s = clock.loop_s / 2 + link.dead_s
            link.disobeying = may_loiter or disobeying[vehicle.column]
            link.speeds_mps = vehicle.autopilot.speeds_mps
            link.stands_after_s, link.returns_after_s = vehicle.stands_after_s, vehicle.returns_after_s
            link.home_m = vehicle.telemetry.home_m
        hold_s = self._hold_s(leader, links)
        links[leader].lag_s += hold_s
        return links, hold_s

    def take(self, tick: Tick, hold_s: float, now: Instant) -> None:
        """Take a tick's setpoints; one that isn't finite is never sent."""
        evades = any(tick.yielding)
        for vehicle in self._vehicles:
            column = vehicle.column
            state = tick.state[column]
            vehicle.setpoints.hurries = evades
            speed_mps, heading_rad, height_m = tick.setpoints[column]
            known = state.north_m + state.east_m + state.height_m + state.wind_north_mps + state.wind_east_mps
            usable = tick.active[column] and finite(speed_mps + heading_rad + height_m + known)
            self._guided[column] = usable
            if usable or vehicle.member is not Member.FLYING:
                self._without[column] = None
            elif self._without[column] is None:
                self._without[column] = now
            if usable:
                due = after(now, hold_s) if column == tick.leader else now
                if due < self._last_due[column]:
                    self._drop(vehicle, due)
                self._last_due[column] = due
                messages = vehicle.new_setpoints(Setpoint(speed_mps, heading_rad, height_m), state, due)
                self._send(vehicle, messages, due, now)
            else:
                vehicle.forget_setpoints()

    def held(self, tick: Tick) -> list[Triple]:
        """Put into a tick what vehicles hold from then on, and return it: what is no news wasn't sent."""
        for vehicle in self._vehicles:
            if self._guided[vehicle.column]:
                tick.setpoints[vehicle.column] = vehicle.setpoints.held.values
        return tick.setpoints

    def _drop(self, vehicle: Vehicle, after_this: Instant) -> None:
        """Drop a vehicle's setpoints delayed until after newer ones, and send the newer ones in full."""
        self._held.drop(lambda due, each: each[0] is vehicle and due > after_this)
        vehicle.forget_setpoints()

    def _send(self, vehicle: Vehicle, messages: list[Message], due: Instant, now: Instant) -> None:
        for message in messages:
            if due <= now:
                self._at_once.append((vehicle, message))
            else:
                self._held.push(due, (vehicle, message))
        self.due = min(self.due, due)

    def stand_ins(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return substitute setpoints for vehicles that need a stream and have none, for a limited time."""
        found = list[tuple[Vehicle, Message]]()
        for vehicle in self._vehicles:
            if self._guided[vehicle.column]:
                self._guided[vehicle.column] = False
            elif vehicle.start_up.acted and not self._is_unguided(vehicle, now):
                found += [(vehicle, message) for message in vehicle.autopilot.stand_in()]
        return found

    def unguided(self, now: Instant) -> frozenset[VehicleId]:
        """Return the vehicles that fly in the formation and have had no setpoints for a while."""
        return frozenset(each.identity for each in self._vehicles if self._is_unguided(each, now))

    def _is_unguided(self, vehicle: Vehicle, now: Instant) -> bool:
        since = self._without[vehicle.column]
        return since is not None and seconds_between(since, now) > UNGUIDED_S

    def pop_due(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Remove and return the messages to send now; none for a vehicle that has left the formation meanwhile."""
        if now < self.due:
            return []
        due = self._held.pop_due(now)
        due += self._at_once
        self._at_once = []
        held = self._held.next()
        self.due = NEVER if held is None else held
        return [each for each in due if each[0].member is Member.FLYING]

    def clear(self) -> None:
        """Drop all delayed messages: no setpoint may follow a command to loiter."""
        self._held, self._at_once, self.due = DelayQueue[tuple[Vehicle, Message]](), [], NEVER
        for vehicle in self._vehicles:
            vehicle.forget_setpoints()
        self._without = [None] * self._count

    def _hold_s(self, leader: int, links: list[VehicleLink]) -> float:
        """Return the delay of the leader's setpoints, s: until the slowest follower's setpoints take effect.

        Without it a leader on a quicker link would turn before its followers can.
        """
        if not self._compensates:
            return 0.0
        own_s, slowest_s = links[leader].until_it_acts_s, 0.0
        for column, link in enumerate(links):
            if link.ready and column != leader and link.until_it_acts_s > slowest_s:
                slowest_s = link.until_it_acts_s
        return min(max(0.0, slowest_s - (0.0 if math.isnan(own_s) else own_s)), HOLD_MAX_S)


class HeartbeatScheduler:
    """Schedules heartbeats and TIMESYNC requests, and creates their messages.

    A heartbeat shows an autopilot that it is being controlled. So a vehicle that should follow setpoints, but has none,
    gets no heartbeats either, and its own failsafe acts.
    """

    def __init__(
        self,
        vehicles: dict[VehicleId, Vehicle],
        note: Note,
        narrow: Collection[VehicleId] = (),
        radios: RadioReports | None = None,
    ) -> None:
        """Start with both due at once; `narrow`: vehicles to which nothing more is sent than needed.

        Nor is it to those behind a radio, as far as `radios` have reported.
        """
        self.next_probe = Instant(0)
        self._vehicles, self._narrow, self._radios = vehicles, set(narrow), radios
        self._due = dict[VehicleId, Instant]()
        """When each vehicle is due for its next request."""
        self._next_common = Instant(0)
        """When those that haven't been asked yet are."""
        self._slower = dict[VehicleId, tuple[float, bool]]()
        """The periods of requests to vehicles, s, and whether they are irregular."""
        self._next_heartbeat = Instant(0)
        self._note, self._withheld = note, frozenset[VehicleId]()
        self._missed = list[Vehicle]()
        """Vehicles of a resumed flight that haven't been heard yet: their failsafe may be about to act."""

    def spare(self, identity: VehicleId, period_s: float, *, irregular: bool) -> None:
        """Send a vehicle requests at this period, or irregularly at this mean period, unless more of them pay."""
        self._slower[identity] = period_s, irregular

    def resume(self, at: Instant) -> None:
        """Send no TIMESYNC request before a flight is resumed, then heartbeats whenever another vehicle is heard."""
        self.next_probe = self._next_common = at
        self._missed = list(self._vehicles.values())

    def hasten(self, now: Instant) -> None:
        """Make the next heartbeat, and the mission time with it, due at once."""
        self._next_heartbeat = now

    def heartbeat_due(self, now: Instant) -> bool:
        """Return whether a heartbeat is due; if so, schedule the next one."""
        if self._missed:
            missed = [each for each in self._missed if each.connection.state is LinkState.SEARCHING]
            if len(missed) < len(self._missed):
                self._missed = missed
                self.hasten(now)
        if now < self._next_heartbeat:
            return False
        self._next_heartbeat = after(now, HEARTBEAT_S)
        return True

    def heartbeats(self, mission_s: float, unguided: Set[VehicleId], now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the heartbeat of every vehicle but the `unguided`, and the mission time once there is one.

        A vehicle that is armed for this flight and hasn't reported its home is asked for it.
        """
        found = list[tuple[Vehicle, Message]]()
        for identity, vehicle in self._vehicles.items():
            if (identity in unguided) != (identity in self._withheld):
                text = "withheld: there is no setpoint for it" if identity in unguided else "sent again"
                self._note(now, "heartbeats", text, vehicle)
            if identity in unguided:
                vehicle.left_alone(now)
                continue
            found.append((vehicle, HEARTBEAT))
            if finite(mission_s):
                since_0_s = seconds_between(Instant(0), now)
                found.append((vehicle, NamedValueFloat(since_0_s, MISSION_TIME, mission_s)))
            if vehicle.home_unreported:
                found.append((vehicle, vehicle.ask(vehicle.autopilot.home_request())))
        self._withheld = frozenset(unguided)
        return found

    def probes(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return a TIMESYNC request for each vehicle that was ever heard and is due, and schedule the next ones.

        When a vehicle is due depends on its own link alone, so that a change of one link leaves the others as they are.
        """
        heard = [each for each in self._vehicles.values() if _is_heard(each)]
        asked = [each for each in heard if now >= self._due.get(each.identity, self._next_common)]
        if now >= self._next_common:
            self._next_common = _next_probe(now, PROBE_S)
        for each in asked:
            self._due[each.identity] = self._next(each, now)
        self.next_probe = min((self._due[each.identity] for each in heard), default=self._next_common)
        self.next_probe = min(self.next_probe, self._next_common)
        return [(vehicle, vehicle.probe(now)) for vehicle in asked]

    def _next(self, vehicle: Vehicle, now: Instant) -> Instant:
        """Return when a vehicle's next request is due.

        Over a full link these are irregular, so that the other messages, which come at regular times, delay them as
        often on the way up as on the way down (RFC 2330, 11.1: "Poisson sampling").
        """
        period_s, irregular = self._slower.get(vehicle.identity, (PROBE_S, False))
        if vehicle.links is not None and not irregular:
            often = vehicle.links.doubtful(now) or self._pays(vehicle, now)
            return _next_probe(now, OFTEN_PROBE_S if often else FAILOVER_PROBE_S)
        if irregular:
            share = (seconds_between(Instant(0), now) / period_s * GOLDEN + vehicle.column * SPREAD) % 1.0
            return after(now, period_s * (0.5 + share))
        return _next_probe(now, OFTEN_PROBE_S if self._pays(vehicle, now) else period_s)

    def _pays(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether more requests would tell its clock better, and its link has room for them."""
        if not vehicle.clock.wants_more or vehicle.identity in self._narrow or vehicle.sequence.loss >= MAX_LOSS:
            return False
        return self._radios is None or self._radios.of(vehicle.connection, now) is None


def _is_heard(vehicle: Vehicle) -> bool:
    """Return whether a vehicle was ever heard, on any link."""
    if vehicle.links is None:
        return vehicle.connection.state is not LinkState.SEARCHING
    return any(link.connection.state is not LinkState.SEARCHING for link in vehicle.each_link)


def _next_probe(now: Instant, period_s: float) -> Instant:
    """Return the next time on the grid of a period, each spread by its number in golden-section steps."""
    number = math.floor(seconds_between(Instant(0), now) / period_s) + 1
    return after(Instant(0), number * period_s + PROBE_DITHER_S * ((number * GOLDEN) % 1.0))

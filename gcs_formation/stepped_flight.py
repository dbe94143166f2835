"""`gcs_formation.Flight`: a flight that a program steps, tick by tick."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from formation_scenario import Scenario
from formation_scenario.orders import Answer, OrderError, parse_order
from formation_scenario.scripted import ScriptedOrder
from formation_scenario.shapes import SHAPE
from formation_scenario.slot_assignment import ids_by_index, index_of
from gcs_formation.app.run_options import ClockName
from gcs_formation.app.script import scripted
from gcs_formation.app.stepping import Stepped, Stop, asynchronously, programs_given, stepped
from gcs_formation.control.plain_values import vehicle_name
from gcs_formation.extend.cycle import Replace, TickView, Vehicle, Wanted
from gcs_formation.phases import OVER
from gcs_formation.python_api import Summary, flown_by, summary_of
from gcs_formation.recorder import Event

Vehicles = int | str | list[int | str] | tuple[int | str, ...]
"""A vehicle's id, "network:id", a list of these, or "all"."""
END = "loiter"
"""The order that ends a flight whose program has left it."""

__all__ = ["Flight", "FlightEvent", "FlightTick"]


@dataclass(frozen=True, slots=True)
class FlightEvent:
    """An event, as a line of events.jsonl."""

    time_s: float
    """Since the run's clock began, s."""
    kind: str
    text: str
    vehicle: int | str | None
    details: Mapping[str, str | int | float | bool | None]

    def __str__(self) -> str:
        """Return it in words."""
        whose = "" if self.vehicle is None else f"vehicle {self.vehicle}, "
        return f"{whose}{self.kind}: {self.text}"


class FlightTick(TickView):
    """A control tick: what the ground station knows and commands."""

    def __init__(self, stop: Stop, identities: list[VehicleId | None], replace: Replace, skipped: int) -> None:
        """Look at the tick at which a flight stopped; `skipped`: ticks since the last that was given."""
        super().__init__(stop.tick, identities, replace)
        self.number = stop.number
        """Its row of the time series, from 1: the first tick after a vehicle has taken off."""
        self.skipped = skipped
        """Ticks since the last that was given; 0 under the virtual clock, which waits."""
        self.events = tuple(_event(each) for each in stop.events)
        """What has happened since the last tick that was given."""

    @property
    def leader(self) -> int | str | None:
        """The leader's id, None for a virtual leader."""
        identity = self._identities[self._tick.leader]
        return None if identity is None else vehicle_name(identity)

    @cached_property
    def vehicles(self) -> dict[int | str, Vehicle]:
        """Every vehicle by its id."""
        return {each.id: each for each in self.every_vehicle}

    def __repr__(self) -> str:
        """Return number, time and phase."""
        return f"FlightTick({self.number}, {self.time_s:.1f} s, {self.phase})"


class Flight:
    """A flight of emulated vehicles that a program steps: a context manager, and an iterator over its control ticks.

    Under the virtual clock the flight waits for the loop, and the program is part of the flight: the same program and
    seed give the same bytes. What it does is written to run.yaml, which repeats the flight without the program. Under
    the real clock the flight goes on, and the loop is given the newest tick.

    Leaving the loop early, also by an exception, ends the flight in order: vehicles loiter, and the record is complete.
    """

    def __init__(  # noqa: PLR0913 - options by name, as `run`'s
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        *,
        clock: ClockName = "virtual",
        seed: int | None = None,
        speedup: float = 1.0,
        until: float | None = None,
        overrides: Mapping[str, Any] | None = None,
        out: str | Path | None = None,
        overwrite: bool = False,
        plugins: Sequence[str | Path] = (),
        sitl: Mapping[str, str | Path] | None = None,
    ) -> None:
        """Prepare a flight, which begins with the `with` statement.

        Args:
            scenario: a path, a mapping with the scenario's keys, or a Scenario.
            clock: "virtual" or "real".
            seed: instead of the scenario's.
            speedup: under the real clock, how many times faster.
            until: mission time in seconds at which to end early.
            overrides: scenario keys by their dotted names: {"law.rate_hz": 5}.
            out: the run directory, new or empty; default: runs/NAME-TIME.
            overwrite: replace an earlier run in `out` when this one begins.
            plugins: files of extensions that the scenario names, as `--plugin`.
            sitl: under the virtual clock, your simulators of real autopilots by their families, whose clocks are
                stepped: {"arduplane": "build/sitl/bin/arduplane"}.

        Raises:
            ScenarioError: the scenario or an override is wrong.
            ValueError: `clock`, `speedup`, `until`, `out` or `sitl` is wrong.
        """
        if sitl and clock != "virtual":
            raise ValueError(f"sitl: found with the {clock} clock; allowed: clock 'virtual', or gcs_formation.run")
        self._programs = programs_given(sitl) if sitl else {}
        keys = dict(overrides or {}) | ({} if seed is None else {"seed": seed})
        given = {"clock": clock, "speedup": speedup, "until_s": until, "overwrite": overwrite}
        self._scenario, self._options = flown_by(scenario, keys, out, given, plugins)
        self._identities: list[VehicleId | None] = list(ids_by_index(self._scenario))
        self._replaced = dict[int, Wanted]()
        """What the program has replaced since it was given a tick, by index."""
        self._steps: Stepped | None = None
        self._number = 0
        self._last: Stop | None = None
        """The tick with which the flight along the path ended."""
        self._summary: Summary | None = None

    @property
    def scenario(self) -> Scenario:
        """What is flown."""
        return self._scenario

    @property
    def run_dir(self) -> Path:
        """Where it is recorded."""
        return self._options.out

    @property
    def summary(self) -> Summary:
        """The figures of the finished flight, as `run` returns them.

        Raises:
            RuntimeError: the flight hasn't ended.
        """
        if self._summary is None:
            raise RuntimeError("the flight has no summary before it has ended")
        return self._summary

    def __enter__(self) -> Self:
        """Begin the flight.

        Raises:
            RunAbortedError: a port is taken, a simulator can't be started.
            ScenarioError: a vehicle can't be simulated by the programs given.
            RecordError: the run directory holds other files or an earlier run, or it can't be written.
        """
        if self._steps is not None or self._summary is not None:
            raise RuntimeError("a flight is entered once; make another Flight")
        self._steps = stepped(self._scenario, self._options, self._programs)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the flight in order, if it hasn't ended, and close the record.

        Raises:
            RunAbortedError: the flight couldn't go on, and no exception is under way.
        """
        steps = self._flying
        try:
            steps.do(self._leave)
            self._summary = summary_of(steps.finish(), self._options.out)
        except Exception as failed:  # whatever it is, it must not hide the exception that is under way
            if error is None:
                raise
            if failed is not error:
                error.add_note(f"the flight ended with: {failed}")
        finally:
            self._steps = None

    def __iter__(self) -> Iterator[FlightTick]:
        """Return the iterator over control ticks, from where it is."""
        return self

    def __next__(self) -> FlightTick:
        """Fly to the next control tick, until the flight is at its end, where no more orders are taken.

        A flight that couldn't go on stops, and the end of `with` raises why.
        """
        tick = self._next()
        if tick is None:
            raise StopIteration
        return tick

    def ending(self) -> Iterator[FlightTick]:
        """Yield the control ticks from the flight's end on, while vehicles are brought to circle, home or down.

        Without it the end of `with` flies them.
        """
        stop, self._last = self._last, None
        while stop is not None:
            yield self._given(stop)
            self._release()
            stop = self._flying.next()

    def __aiter__(self) -> AsyncIterator[FlightTick]:
        """Return the same for `async for`: other tasks go on while the flight flies to its next tick."""
        return self

    async def __anext__(self) -> FlightTick:
        """Fly to the next control tick in a thread."""
        tick = await asynchronously(self._next)
        if tick is None:
            raise StopAsyncIteration
        return tick

    def _next(self) -> FlightTick | None:
        if self._last is not None:
            return None
        self._release()
        stop = self._flying.next()
        if stop is None or stop.ends:
            self._last = stop
            return None
        return self._given(stop)

    def _given(self, stop: Stop) -> FlightTick:
        skipped, self._number = stop.number - self._number - 1, stop.number
        return FlightTick(stop, self._identities, self._replace, skipped)

    def tell(self, order: str) -> Answer:
        """Give the formation an order, as `gcs-formation tell` does: `shape line`, `speed 24`, `loiter`, ….

        Raises:
            OrderError: the text isn't an order, or it is refused; the message says why.
        """
        parse_order(order, shapes=self._scenario.registered.names(SHAPE))
        answer = self._do({"order": order})
        if not answer.accepted:
            raise OrderError(answer.text)
        return answer

    def link(self, vehicles: Vehicles = "all", **keys: Any) -> None:
        """Change links from now on: `delay_ms`, `jitter_ms`, `loss`, `outage` and all keys of `links.changes`.

        Args:
            vehicles: whose: an id, a list of ids, or "all".
            **keys: for both directions; `uplink` and `downlink` are mappings of the same keys for one.

        Raises:
            ScenarioError: no such vehicle or key, or a value that isn't allowed.
        """
        self._do({"link": {"vehicles": _selection(vehicles), **keys}})

    def inject(self, kind: str, vehicle: Vehicles = "all", *, for_s: float | None = None, **keys: Any) -> None:
        """Inject a fault into emulated vehicles now: `freeze`, `crash` and all kinds of `faults`.

        Args:
            kind: the kind of fault; one that an extension registers has its own keys in `parameters`.
            vehicle: whose: an id, a list of ids, or "all".
            for_s: how long it lasts, s; default: for good, if its kind may last.
            **keys: further keys of `faults`.

        Raises:
            ScenarioError: no such vehicle, kind or key, or a value that isn't allowed.
        """
        lasts = {} if for_s is None else {"until_s": for_s}
        self._do({"fault": {"kind": kind, "vehicles": _selection(vehicle), **lasts, **keys}})

    def disturb(
        self, kind: str = "step", vehicle: Vehicles = "all", *, for_s: float | None = None, **keys: Any
    ) -> None:
        """Add a velocity to the air at emulated vehicles from now on, by the keys of `disturbances`.

        Args:
            kind: `step`, `ramp`, `sine` or `dryden`, or one that an extension registers, with `parameters`.
            vehicle: whose: an id, a list of ids, or "all".
            for_s: how long it acts, s; default: to the end.
            **keys: `velocity_mps` and the kind's further keys.

        Raises:
            ScenarioError: no such vehicle, kind or key, or a value that isn't allowed.
        """
        lasts = {} if for_s is None else {"until_s": for_s}
        added = {"kind": kind, "at_s": 0.0, "vehicles": _selection(vehicle), **lasts, **keys}
        self._do({"disturbance": added})

    def replace(
        self,
        vehicle: int | str,
        *,
        speed_mps: float | None = None,
        heading_rad: float | None = None,
        height_m: float | None = None,
    ) -> None:
        """Command a vehicle otherwise than the law does, as a filter would: from now on until the next tick was given.

        So a loop calls it at each tick at which it replaces. It comes after all filters, within the vehicle's
        envelope; fence, separation rule and ground come after it. A vehicle that isn't commanded stays so.
        `tick.vehicles[2].replace(…)` is the same.

        Args:
            vehicle: its id.
            speed_mps: airspeed, of multirotors speed over ground; None: the law's.
            heading_rad: clockwise from north; None: the law's.
            height_m: above the origin; None: the law's.

        Raises:
            ValueError: no such vehicle, or a value that isn't finite.
        """
        self._replace(index_of(self._scenario, vehicle), (speed_mps, heading_rad, height_m))

    def _replace(self, index: int, wanted: Wanted) -> None:
        steps = self._flying
        for part in wanted:
            if part is not None and not math.isfinite(part):
                raise ValueError(f"found {part}; allowed: a finite number")
        before = self._replaced.get(index, wanted)
        speed_mps, heading_rad, height_m = (
            old if new is None else new for old, new in zip(before, wanted, strict=True)
        )
        merged = speed_mps, heading_rad, height_m
        self._replaced[index] = merged
        steps.do(lambda now: steps.session.script.replace(index, merged, now))

    def _release(self) -> None:
        """Give back to the law what the program hasn't replaced since it was given a tick."""
        steps, kept = self._flying, self._replaced
        if steps.session.script.replaces:
            steps.do(lambda _: steps.session.script.keep_replaced(kept))
        self._replaced = {}

    @property
    def _flying(self) -> Stepped:
        if self._steps is None:
            raise RuntimeError("the flight isn't flying; it does inside `with Flight(...) as flight:`")
        return self._steps

    def _do(self, keys: dict[str, Any]) -> Answer:
        steps = self._flying
        if steps.session.station.flight.ended:
            raise OrderError("found a flight that is over; allowed: one that is flying")
        act = scripted(self._scenario, keys)

        def do(now: Instant) -> Answer:
            ticks = steps.session.station.recorded_ticks
            return steps.session.script.do(act.model_copy(update={"at_tick": ticks}), now)

        return steps.do(do)

    def _leave(self, now: Instant) -> None:
        """End a flight that goes on by the order that a program could have given."""
        session = self._flying.session
        flight = session.station.flight
        if not flight.ended and flight.phase not in OVER:
            session.script.do(ScriptedOrder(at_tick=session.station.recorded_ticks, order=END), now)


def _selection(vehicles: Vehicles) -> Any:  # noqa: ANN401 - as a scenario's keys are typed
    if vehicles == "all":
        return "all"
    return list(vehicles) if isinstance(vehicles, list | tuple) else [vehicles]


def _event(event: Event) -> FlightEvent:
    whose = None if event.vehicle is None else vehicle_name(event.vehicle)
    return FlightEvent(event.now / NANOSECONDS, event.kind, event.text, whose, event.details)

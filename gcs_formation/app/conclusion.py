"""What is written when a flight is over: the time series, each link's figures, the summary."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.impaired_link import ImpairedEngine
from formation_scenario import Scenario
from gcs_formation.app.link_figures import of_one_link, of_several_links, with_each_link
from gcs_formation.app.link_injection import InjectedDelays, injected, planned_end_s
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.timed_station import TimedStation
from gcs_formation.core.feature import derived
from gcs_formation.link.link_health import LOST_AFTER_S
from gcs_formation.link.radio_reports import RadioReport
from gcs_formation.link.vehicle_links import Link
from gcs_formation.record.expectations import RunOutcome
from gcs_formation.record.figures_of_merit import if_finite, percentile
from gcs_formation.record.flight import FlightBuilder, down_at_end, judged, tables
from gcs_formation.record.limits_by_truth import Truth
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.radio import figures as radio_figures
from gcs_formation.record.radio import with_radio
from gcs_formation.record.run_directory import SPOOL, TIMESERIES, RunDirectory
from gcs_formation.record.several_links import with_several_links
from gcs_formation.record.summary import Summary, summarise
from gcs_formation.record.timeseries import Spool, spools
from gcs_formation.record.unfinished import recorded_events
from gcs_formation.stability import scenario_delay_margin


class FlightTimes(NamedTuple):
    """When a flight began, when it ended or the operator left it, and now."""

    began: Instant
    ended: Instant
    now: Instant


class InjectedLinks(NamedTuple):
    """What is known of the delays of each direction."""

    delays: InjectedDelays
    links: ImpairedEngine | None
    """What impaired the links, if anything did."""
    emulated: bool
    """Whether the links add nothing else."""
    keeps_utc: bool
    """Whether the machine's clock has the vehicles' UTC."""


class Conclusion:
    """Makes the summary of a flight that is over from its record and its station."""

    def __init__(
        self,
        station: TimedStation,
        recorder: RunDirectory,
        scenario: Scenario,
        options: RunOptions,
        times: FlightTimes,
        injected_links: InjectedLinks,
    ) -> None:
        """Take what was flown; `recorder` is closed, `scenario` as it was planned."""
        self._station, self._recorder, self._scenario = station, recorder, scenario
        self._options, self._times, self._injected = options, times, injected_links

    def summary(self, truth: Truth | None, wall_s: float) -> Summary:
        """Write the time series and the summary; return the summary.

        Raises:
            OSError: a file can't be written.
        """
        spool = self._recorder.path / SPOOL
        rows, building = Spool(spool), FlightBuilder(self._scenario)
        injected_s = self._injected.delays.series_s(rows.ticks)
        radios = [self._radio_reports(each.vehicle_id) for each in self._scenario.vehicles]
        events, ended_s = recorded_events(self._recorder.path)[0], self._times.ended / NANOSECONDS
        blocks = with_radio(tables(rows.blocks(), self._scenario, truth, injected_s), radios)
        links = [of_several_links(self._station.vehicles[each.vehicle_id]) for each in self._scenario.vehicles]
        vehicles = [str(each.vehicle_id) for each in self._scenario.vehicles]
        passing = building.passing(derived(with_several_links(blocks, links), events, vehicles))
        if self._options.record in {"full", "series"}:
            from gcs_formation.record.parquet import write_parquet  # noqa: PLC0415 - check's short flights write none

            write_parquet(self._recorder.path / TIMESERIES, passing)
        else:
            for _ in passing:
                pass
        flight, phase_machine = building.flight(), self._station.phase_machine
        if phase_machine.failure is None and flight.truth:
            phase_machine.failure = down_at_end(flight)
        summary = summarise(
            RunOutcome(
                scenario=self._scenario,
                clock=self._options.clock,
                flight=judged(flight, self._scenario, truth, events, ended_s),
                links={identity: self._link(identity) for identity in self._station.vehicles},
                ticks_s=self._station.times_s(),
                delay_margin_s=if_finite(scenario_delay_margin(self._station.cycle.findings.tuned)),
                worst_loop_delay_s=self._worst_loop_delay_s(),
                margin_used=self._station.cycle.findings.max_used,
                received=self._station.received(),
                frames_refused=self._station.refused(),
                simulated_s=seconds_between(self._times.began, self._times.now),
                wall_s=wall_s,
                cut_short=self._station.phase_machine.cut_short,
                assembled=self._station.phase_machine.assembled,
                undone=tuple(self._station.orders.undone),
                unsafe=tuple(self._station.phase_machine.unsafe),
                flying_on=dict(self._station.phase_machine.flying_on),
                not_landed=self._station.phase_machine.not_landed,
                failure=self._station.phase_machine.failure,
                features=self._station.features,
                measure=self._options.measure,
            )
        )
        self._recorder.write_summary(summary.to_dict())
        for part in spools(spool):
            part.unlink()
        return summary

    def _due_to_s(self, identity: VehicleId) -> float:
        """Return the mission time from which a planned fault silenced a vehicle to the end; infinity if none did.

        The time spent on ending the flight doesn't count.
        """
        return planned_end_s(self._scenario, identity, self._station.flight.mission_time_s(self._times.ended))

    def _received_to_s(self, identity: VehicleId) -> float:
        """Return the mission time of the last frame of a vehicle that was lost by the end; infinity for others."""
        last = self._station.vehicles[identity].connection.last_received
        known = seconds_between(last, self._times.ended) >= LOST_AFTER_S and self._station.flight.path_began is not None
        return self._station.flight.mission_time_s(last) if known else math.inf

    def _radio_reports(self, identity: VehicleId) -> list[RadioReport]:
        return self._station.radio_reports.all_of(self._station.vehicles[identity].connection)

    def _link(self, identity: VehicleId) -> LinkFigures:
        vehicle = self._station.vehicles[identity]
        due_to_s, began = self._due_to_s(identity), self._station.flight.path_began
        due = after(began, due_to_s) if began is not None and math.isfinite(due_to_s) else self._times.ended
        vehicle.end_silence(min(self._times.ended, due))
        knows_asymmetry = self._injected.keeps_utc or vehicle.round_trips.own is not None
        one_link = partial(self._one_link, identity, knows_asymmetry=knows_asymmetry)
        whole = replace(
            one_link(vehicle.each_link[0]),
            measured_loss=self._station.cycle.findings.losses[identity].whole_loss,
            frames_in=vehicle.frames_in,
            frames_out=vehicle.frames_out,
            frames_bad=self._station.bad_frames(identity),
            frames_implausible=vehicle.telemetry.implausible,
            frames_duplicate=sum(int(link.history.copies) for link in vehicle.each_link),
            frames_late=sum(int(link.history.late) for link in vehicle.each_link),
            **self._authentication(identity),
            due_to_s=due_to_s,
            heard_to_s=self._received_to_s(identity),
            radio=radio_figures(self._radio_reports(identity)),
        )
        return with_each_link(whole, vehicle, one_link, self._station, self._times.ended)

    def _one_link(self, identity: VehicleId, link: Link, *, knows_asymmetry: bool) -> LinkFigures:
        uninjected = (0.0, 0.0, 0.0, 0.0) if self._injected.emulated else None
        what = injected(self._injected.links.statistics(identity, link.number)) if self._injected.links else uninjected
        return of_one_link(link, self._station, what, knows_asymmetry=knows_asymmetry)

    def _authentication(self, identity: VehicleId) -> dict[str, Any]:
        """Return whether all frames taken as a vehicle's were signed with its link's key, and how many weren't."""
        signatures = self._station.signatures
        if not signatures.is_signed(identity):
            return {"authenticated": False, "frames_unverified": signatures.unverified(identity)}
        judged = signatures.judged(identity)
        return {
            "authenticated": judged.unsigned == 0,
            "frames_unverified": judged.unsigned,
            "refused": {verdict.name.lower(): count for verdict, count in judged.refused.items()},
        }

    def _worst_loop_delay_s(self) -> float | None:
        """Return the longest measured loop delay, sampling and hold included; in real time with computing time."""
        computes = self._options.clock == "real" and self._station.controlled_ticks > 0
        compute_s = percentile(self._station.times_s()[2], 50) if computes else 0.0
        return if_finite(self._station.cycle.findings.longest_s + compute_s)

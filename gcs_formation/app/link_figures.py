"""What was measured, counted and injected on each link of a vehicle, for the record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array
from gcs_formation.link.vehicle_links import Link
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.several_links import OneLink, Uses, together, used_s
from gcs_formation.station import Station
from gcs_formation.vehicle.vehicle import Vehicle


def of_one_link(
    link: Link, station: Station, injected: tuple[float, float, float, float] | None, *, knows_asymmetry: bool
) -> LinkFigures:
    """Return one link's figures, with what was `injected` into it.

    Without `knows_asymmetry` delays up and down are left out: a UTC error that all vehicles share would show in them.
    """
    began, probes = station.flight.path_began, _probes(link)
    if not knows_asymmetry:
        probes[:, 2:] = np.nan
    return LinkFigures(
        delays_s=probes[:, 1:],
        delay_times_s=(probes[:, 0] - began) / NANOSECONDS if began is not None else np.full(len(probes), np.nan),
        measured_loss=link.sequence.whole_loss,
        frames_in=int(link.sequence.received + link.sequence.repeated),
        frames_out=link.frames_out,
        frames_bad=station.bad_frames_of(link.connection),
        injected=injected,
        probed_ns=probes[:, 0],
    )


def with_each_link(
    whole: LinkFigures, vehicle: Vehicle, one_link: Callable[[Link], LinkFigures], station: Station, ended: Instant
) -> LinkFigures:
    """Return a vehicle's figures with those of each of its links, where it has several."""
    links = vehicle.links
    if links is None:
        return whole
    times_s = used_s(links.used, ended)
    each = [
        OneLink(
            link.number,
            str(station.endpoints()[link.connection.socket]),
            times_s.get(link.number, 0.0),
            link.jitter.jitter_s,
            one_link(link),
        )
        for link in links.each
    ]
    return replace(whole, **together(each, links.used))


def of_several_links(vehicle: Vehicle) -> tuple[Uses, list[Array]] | None:
    """Return when which link was in use, and each one's answered requests (P, 4); None for a vehicle with one link."""
    links = vehicle.links
    return None if links is None else (links.used, [_probes(link) for link in links.each])


def _probes(link: Link) -> Array:
    return np.frombuffer(link.round_trips.delays.getvalue(), "<f8").reshape(-1, 4).copy()

"""Reports of telemetry radios: taken from where vehicles are reached, and never a vehicle's."""

from airlink.clock import Instant, after
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.system import Heartbeat, RadioStatus
from airlink.receiver import Receiver
from gcs_formation.link.link_health import Connection
from gcs_formation.link.radio_reports import STALE_S, RadioReports

LINE, ELSEWHERE = Address("127.0.0.1", 14551), Address("127.0.0.1", 9)
FULL = RadioStatus(rssi=130, remrssi=120, txbuf=7, noise=40, remnoise=41, rxerrors=3, fixed=2)


def taken(reports: RadioReports, message: Message, peer: Address = LINE, socket: int = 0, component: int = 68) -> bool:
    datagram = Datagram(socket, peer, FrameWriter(51, component).encode(message))
    frame = Receiver().first(datagram, Instant(0))
    assert frame is not None
    return reports.receive(frame, datagram, Instant(0))


def test_a_report_is_about_every_vehicle_that_is_reached_where_it_came_from() -> None:
    one, other, difference = Connection(0, LINE), Connection(0, LINE), Connection(1, LINE)
    reports = RadioReports([one, other, difference])
    assert taken(reports, FULL)
    for each in (one, other):
        report = reports.of(each, Instant(0))
        assert report is not None
        assert (report.rssi, report.remrssi, report.noise, report.remnoise) == (130, 120, 40, 41)
        assert (report.txbuf_percent, report.rxerrors, report.fixed) == (7, 3, 2)
    assert reports.of(difference, Instant(0)) is None
    assert reports.of(Connection(0), Instant(0)) is None


def test_a_report_from_elsewhere_or_of_something_else_is_not_taken() -> None:
    vehicle = Connection(0, LINE)
    reports = RadioReports([vehicle])
    assert not taken(reports, FULL, peer=ELSEWHERE)
    assert not taken(reports, FULL, socket=1)
    assert not taken(reports, FULL, component=1)
    assert not taken(reports, Heartbeat(6, 8))
    assert reports.of(vehicle, Instant(0)) is None


def test_an_old_report_says_nothing_and_a_buffer_is_never_over_full() -> None:
    vehicle = Connection(0, LINE)
    reports = RadioReports([vehicle])
    assert taken(reports, RadioStatus(130, 120, 255, 40, 41, 0, 0))
    report = reports.of(vehicle, after(Instant(0), STALE_S))
    assert report is not None
    assert report.txbuf_percent == 100
    assert reports.of(vehicle, after(Instant(0), STALE_S + 0.1)) is None

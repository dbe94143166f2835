import pytest

from airlink.clock import Instant, VirtualClock, after
from airlink.endpoint import Address, PortError
from airlink.engine import Datagram, MemoryNetwork
from tests.airlink.engines import PlainEngine

GROUND = Address("127.0.0.1", 14550)


class Beacon(PlainEngine):
    """Sends its name and a number every period, and answers each datagram with it."""

    def __init__(self, name, endpoint, period_s=0.0, answers=False):
        super().__init__(endpoint)
        self.name, self.period_s, self.answers, self.sent = name, period_s, answers, 0
        self.timer = Instant(0) if period_s else None

    def take(self, datagram, now):
        self.received.append((now, datagram.peer, datagram.data))
        if self.answers:
            self.outbox.append(datagram)

    def handle_timer(self, now):
        self.timer = after(now, self.period_s)
        self.sent += 1
        self.outbox.append(Datagram(0, self.wanted[0].address, f"{self.name}{self.sent}".encode()))


def network_of(*engines):
    network = MemoryNetwork(VirtualClock())
    for engine in engines:
        network.attach(engine)
    return network


def run_until(network, seconds):
    network.run(lambda: network.clock.now() >= after(Instant(0), seconds))


def test_datagrams_arrive_at_once_and_answers_find_the_sender():
    ground = Beacon("g", "udpin:0.0.0.0:14550", answers=True)
    first, second = (Beacon(name, "udpout:127.0.0.1:14550", 0.5) for name in "ab")
    run_until(network_of(ground, first, second), 1.0)
    assert [(now, data) for now, _, data in ground.received[:4]] == [
        (0, b"a1"),
        (0, b"b1"),
        (500_000_000, b"a2"),
        (500_000_000, b"b2"),
    ]
    assert [data for _, _, data in first.received[:2]] == [b"a1", b"a2"]
    assert all(peer == GROUND for _, peer, _ in first.received + second.received)
    assert len({peer for _, peer, _ in ground.received}) == 2


def test_a_run_repeats_itself():
    def record():
        ground = Beacon("g", "udpin:127.0.0.1:14550", answers=True)
        others = [Beacon(name, "udpout:127.0.0.1:14550", period) for name, period in (("a", 0.3), ("b", 0.2))]
        run_until(network_of(ground, *others), 5.0)
        return ground.received

    assert record() == record()


def test_what_no_one_listens_for_is_lost_and_an_idle_network_stops():
    lonely = Beacon("a", "udpout:127.0.0.1:14550")
    lonely.outbox.append(Datagram(0, GROUND, b"x"))
    network_of(lonely).run(lambda: False)
    assert lonely.received == []


def test_what_is_sent_on_start_arrives_though_no_timer_runs():
    ground = Beacon("g", "udpin:127.0.0.1:14550")
    sender = Beacon("a", "udpout:127.0.0.1:14550")
    sender.outbox.append(Datagram(0, GROUND, b"x"))
    network_of(ground, sender).run(lambda: False)
    assert [data for _, _, data in ground.received] == [b"x"]


@pytest.mark.parametrize("taken", ["udpin:127.0.0.1:14550", "udpin:0.0.0.0:14550"])
@pytest.mark.parametrize("wanted", ["udpin:127.0.0.1:14550", "udpin:0.0.0.0:14550"])
def test_a_port_is_taken_once(taken, wanted):
    network = network_of(Beacon("a", taken))
    with pytest.raises(PortError, match="14550 is taken"):
        network.attach(Beacon("b", wanted))


def test_a_port_of_the_networks_choice_is_a_free_one():
    network = network_of(Beacon("a", "udpin:0.0.0.0:49152"))
    network.attach(Beacon("b", "udpout:127.0.0.1:49152"))


def test_an_engine_attached_late_receives_what_is_sent_to_its_address():
    sender = Beacon("a", "udpout:127.0.0.1:14550", 0.5)
    network = network_of(sender)
    run_until(network, 1.0)
    ground = Beacon("g", "udpin:127.0.0.1:14550")
    network.attach(ground)
    run_until(network, 1.6)
    assert [data for _, _, data in ground.received] == [b"a4", b"a5"]

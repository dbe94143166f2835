"""A stream parser for each remote, for 1024 of them at most."""

from airlink.clock import Instant
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.receiver import Receiver

NO_FRAME = b"\x00" * 7


def test_of_more_remotes_than_1024_the_one_silent_longest_is_forgotten_and_still_counted() -> None:
    receiver, peers = Receiver(), [Address("127.0.0.1", port) for port in range(1, 1026)]
    for peer in (*peers[:1024], peers[0]):
        receiver.first(Datagram(0, peer, NO_FRAME), Instant(0))
    assert all(receiver.counts(0, peer).garbage_bytes for peer in peers[:1024])
    receiver.first(Datagram(0, peers[1024], NO_FRAME), Instant(0))
    forgotten = [peer for peer in peers if not receiver.counts(0, peer).garbage_bytes]
    assert forgotten == [peers[1]]
    assert receiver.total().garbage_bytes == 1026 * len(NO_FRAME)

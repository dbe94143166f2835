"""Common parts of the engines in these tests."""

from airlink.clock import Instant
from airlink.endpoint import parse_endpoint
from airlink.engine import Engine


class PlainEngine(Engine):
    """Has sockets, receives datagrams one by one, and sends what is in its outbox."""

    def __init__(self, *endpoints):
        self.wanted = tuple(parse_endpoint(text) for text in endpoints)
        self.received, self.outbox = [], []
        self.timer: Instant | None = Instant(0)

    def endpoints(self):
        return self.wanted

    def datagrams_to_send(self):
        sent, self.outbox = self.outbox, []
        return sent

    def next_timer(self):
        return self.timer

    def take(self, datagram, now): ...

    def handle_timer(self, now): ...

    def receive(self, datagrams, now):
        for datagram in datagrams:
            self.take(datagram, now)

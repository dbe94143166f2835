"""What the engines of these tests have in common."""

from airlink.clock import Instant
from airlink.endpoint import parse_endpoint
from airlink.engine import Engine


class PlainEngine(Engine):
    """Has sockets, takes datagrams one by one, and gives away what it has put into its outbox."""

    def __init__(self, *endpoints):
        self.wanted = tuple(parse_endpoint(text) for text in endpoints)
        self.heard, self.outbox = [], []
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

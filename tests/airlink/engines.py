"""What the engines of these tests have in common."""

from airlink.clock import Instant
from airlink.endpoint import parse_endpoint


class PlainEngine:
    """Has sockets, and gives away what it has put into its outbox."""

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

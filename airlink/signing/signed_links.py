"""An engine's links, each with its key or none: what leaves is signed, what arrives is judged and counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.receiver import Receiver
from airlink.signing.authentication import Authentication, Verdict
from airlink.signing.signature import unsigned

OF_RADIOS: Final = frozenset((m.MAVLINK_MSG_ID_RADIO_STATUS, m.MAVLINK_MSG_ID_RADIO))
"""Messages that a telemetry radio sends itself, without a key: taken unsigned, but not in an autopilot's name."""
AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
MAX_BEHIND: Final = 16


@dataclass
class Judged:
    """How many frames with one system's id were refused, by their verdict, and how many were taken unsigned."""

    refused: dict[Verdict, int] = field(default_factory=dict[Verdict, int])
    unsigned: int = 0

    @property
    def frames_refused(self) -> int:
        """Number of those that were refused, whatever the cause."""
        return sum(self.refused.values())

    def refuse(self, verdict: Verdict) -> None:
        """Count one that is refused."""
        self.refused[verdict] = self.refused.get(verdict, 0) + 1

    def add(self, other: Judged) -> None:
        """Add others' counts."""
        self.unsigned += other.unsigned
        for verdict, count in other.refused.items():
            self.refused[verdict] = self.refused.get(verdict, 0) + count


def _kept(frame: Frame | None, keeps: Callable[[Frame], bool]) -> Frame | None:
    """Return the first of those linked frames for which `keeps` holds, linked to the others."""
    first: Frame | None = None
    last: Frame | None = None
    while frame is not None:
        following, frame.following = frame.following, None
        if keeps(frame):
            if last is None:
                first = frame
            else:
                last.following = frame
            last = frame
        frame = following
    return first


class SignedLink:
    """One link with a key."""

    def __init__(self, authentication: Authentication, *, link_id: int = 0, takes_unsigned: bool = False) -> None:
        """Take the key's state; `takes_unsigned`: whether frames without a signature are taken, and counted."""
        self.authentication, self._link_id, self.takes_unsigned = authentication, link_id, takes_unsigned
        self.judged = dict[int, Judged]()
        """By the system id that the frames had."""
        self.behind = dict[Address, None]()
        """Who is to be sent something: all its frames are authentic and old, so it has yet to learn how late it is.

        It may have no clock, or have lost its timestamps. Somebody who plays a recording is sent no more than that.
        """

    def seal(self, raw: bytes, now: Instant) -> bytes:
        """Return a frame with a signature."""
        return self.authentication.sign(raw, self._link_id, now)

    def admitted(self, frame: Frame | None, peer: Address, now: Instant) -> Frame | None:
        """Return the first of the frames that are taken, of some that are linked, linked to the others."""
        return _kept(frame, lambda each: self._admits(each, peer, now))

    def _admits(self, frame: Frame, peer: Address, now: Instant) -> bool:
        verdict = self.authentication.verify(frame.raw, now)
        if verdict is Verdict.AUTHENTIC:
            return True
        if verdict is Verdict.UNSIGNED and frame.message_id in OF_RADIOS and frame.component != AUTOPILOT:
            return True
        judged = self.judged.get(frame.system)
        if judged is None:
            judged = self.judged[frame.system] = Judged()
        if verdict is Verdict.UNSIGNED and self.takes_unsigned:
            judged.unsigned += 1
            return True
        judged.refuse(verdict)
        old = verdict is Verdict.STALE or verdict is Verdict.REPLAYED
        if old and len(self.behind) < MAX_BEHIND and self.authentication.is_silent(frame.raw, now):
            self.behind[peer] = None
        return False


class SignedLinks:
    """The links of an engine, by its socket."""

    def __init__(self, links: Sequence[SignedLink | None], reserved: Sequence[frozenset[int]] = ()) -> None:
        """Take each socket's link, None where nothing is signed.

        `reserved`: for each socket the system ids that aren't taken there, because their link has another key.
        """
        self.links = tuple(links)
        self.reserved = tuple(reserved) or (frozenset[int](),) * len(self.links)
        self._elsewhere = [dict[int, Judged]() for _ in self.links]
        """Frames of these, by socket and system id."""

    def copied(self) -> SignedLinks:
        """Return the same links for a second reader of the same frames, which is apart from the first."""
        states = {id(link.authentication): link.authentication.copied() for link in self.links if link is not None}
        links = [
            None if link is None else SignedLink(states[id(link.authentication)], takes_unsigned=link.takes_unsigned)
            for link in self.links
        ]
        return SignedLinks(links, self.reserved)

    def seal(self, socket: int, raw: bytes, now: Instant) -> bytes:
        """Return a frame as it is sent on a socket."""
        link = self.links[socket]
        return raw if link is None else link.seal(raw, now)

    def admitted(self, socket: int, frame: Frame | None, peer: Address, now: Instant) -> Frame | None:
        """Return the first of the frames that are taken at a socket, of some that are linked, linked to the others."""
        link = self.links[socket]
        if self.reserved[socket]:
            frame = _kept(frame, lambda each: self._is_here(socket, each))
        return frame if link is None else link.admitted(frame, peer, now)

    def _is_here(self, socket: int, frame: Frame) -> bool:
        here = frame.system not in self.reserved[socket]
        if not here:
            self._elsewhere[socket].setdefault(frame.system, Judged()).refuse(Verdict.ELSEWHERE)
        return here

    def judged(self, sockets: Sequence[int], system: int) -> Judged:
        """Return what was made of the frames with a system's id at some sockets."""
        total = Judged()
        for socket in sockets:
            link = self.links[socket]
            for each in (self._elsewhere[socket].get(system), None if link is None else link.judged.get(system)):
                if each is not None:
                    total.add(each)
        return total

    @property
    def frames_refused(self) -> int:
        """Number of frames refused at all sockets."""
        judged = [each for link in self.links if link is not None for each in link.judged.values()]
        judged += [each for elsewhere in self._elsewhere for each in elsewhere.values()]
        return sum([each.frames_refused for each in judged])

    def take_behind(self) -> list[tuple[int, Address]]:
        """Remove and return the remotes, each with its socket, that are to be sent something."""
        found = list[tuple[int, Address]]()
        for socket, link in enumerate(self.links):
            if link is not None:
                found += [(socket, peer) for peer in link.behind]
                link.behind.clear()
        return found


def receiver_of(links: SignedLinks | None) -> Receiver:
    """Return what parses an engine's datagrams: with judgement if any link has a key."""
    return Receiver() if links is None else VerifyingReceiver(links)


class VerifyingReceiver(Receiver):
    """Parses the datagrams of every remote, and passes on what their links' keys admit, without signatures."""

    def __init__(self, links: SignedLinks) -> None:
        """Judge by `links`."""
        super().__init__()
        self._links = links

    def first(self, datagram: Datagram, now: Instant) -> Frame | None:
        """Return the first of the frames that a datagram completes and that are taken."""
        first = admitted = self._admitted(datagram, now)
        if self._links.links[datagram.socket] is None:
            return first
        while admitted is not None:
            admitted.raw = unsigned(admitted.raw)
            admitted = admitted.following
        return first

    def passed(self, datagram: Datagram, now: Instant) -> bytes:
        """Return the frames that are taken as they came, one after another, for somebody else to read."""
        if self._links.links[datagram.socket] is None and not self._links.reserved[datagram.socket]:
            return datagram.data
        frame, raws = self._admitted(datagram, now), list[bytes]()
        while frame is not None:
            raws.append(frame.raw)
            frame = frame.following
        return b"".join(raws)

    def _admitted(self, datagram: Datagram, now: Instant) -> Frame | None:
        found = super().first(datagram, now)
        return self._links.admitted(datagram.socket, found, datagram.peer, now)

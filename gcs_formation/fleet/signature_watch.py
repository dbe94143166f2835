"""Reports whose frames are refused by their signatures, and why; and who signs where there is no key to verify it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.receiver import Receiver
from airlink.signing.authentication import Verdict
from airlink.signing.signed_links import Judged, SignedLinks
from gcs_formation.link.link_health import Connection
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.vehicle import Vehicle

MEANING: Final = {
    Verdict.WRONG_KEY: "another key than this link's, or another sender with this id",
    Verdict.REPLAYED: "copies, a recording that is played again, or its clock is behind until it receives from us",
    Verdict.STALE: "its clock is behind until it receives from us, or a recording is played again",
    Verdict.ELSEWHERE: "another sender has its id",
    Verdict.UNSIGNED: "it has no key (`gcs-formation signing setup` gives it one), or another sender has its id",
}
TAKEN_UNSIGNED: Final = "unsigned frames are taken (signing.unsigned: accept)"
UNVERIFIED: Final = "its frames are signed, and its link has no key here: they prove nothing, and it may refuse ours"


class SignatureWatch:
    """Reports each vehicle once for each cause for which its frames, or frames with its id, are refused."""

    def __init__(
        self,
        signing: SignedLinks | None,
        receiver: Receiver,
        networks: Sequence[int],
        vehicles: Mapping[VehicleId, Vehicle],
        log_event: LogEvent,
    ) -> None:
        """Watch what `signing` refuses, None without any key; `networks[s]` is the network of socket s."""
        self.signing, self._receiver, self._networks = signing, receiver, networks
        self._vehicles, self._log_event = vehicles, log_event
        self._reported = set[tuple[VehicleId, str]]()

    @property
    def frames_refused(self) -> int:
        """Number of frames that were refused."""
        return 0 if self.signing is None else self.signing.frames_refused

    def report(self, now: Instant) -> None:
        """Report what is new; called once a second."""
        for identity, vehicle in self._vehicles.items():
            if not self.is_signed(identity):
                if self.unverified(identity):
                    self._report(vehicle, UNVERIFIED, now)
                continue
            judged = self.judged(identity)
            for verdict in judged.refused:
                text = f"frames with its id are refused, {verdict.value}: {MEANING[verdict]}"
                self._report(vehicle, text, now)
            if judged.unsigned:
                self._report(vehicle, TAKEN_UNSIGNED, now)

    def _report(self, vehicle: Vehicle, text: str, now: Instant) -> None:
        if (vehicle.identity, text) not in self._reported:
            self._reported.add((vehicle.identity, text))
            self._log_event(now, "signing", text, vehicle)

    def judged(self, identity: VehicleId) -> Judged:
        """Return what was made of the frames with a vehicle's system id on its network."""
        own = [socket for socket, network in enumerate(self._networks) if network == identity.network]
        return Judged() if self.signing is None else self.signing.judged(own, identity.system)

    def unverified(self, identity: VehicleId) -> int:
        """Return how many frames with a signature came from a vehicle's address, by any signer."""
        connection = self._vehicles[identity].connection
        return self._receiver.counts(connection.socket, connection.peer).signed

    def is_open(self, connection: Connection) -> bool:
        """Return whether a link has no key."""
        return self.signing is None or self.signing.links[connection.socket] is None

    def is_signed(self, identity: VehicleId) -> bool:
        """Return whether a vehicle's link has a key."""
        return self.signing is not None and self.signing.links[self._vehicles[identity].connection.socket] is not None

"""Two peers with a network between them that has a clock of its own, a delay and losses that repeat."""

import heapq
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from random import Random
from typing import Any

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import dtls_context
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.peer import Peer, PeerSettings
from lockstep.rtc.peer_events import PeerEvent
from lockstep.rtc.rtp.stage import earliest
from lockstep.rtc.sdp import SessionDescription, parse_description, write_description

__all__ = ["DELAY", "PeerPair", "through_text"]

DELAY = 0.02  # s, one way
CERTIFICATES = [Certificate.generate(), Certificate.generate()]
CONTEXTS = [dtls_context(certificate) for certificate in CERTIFICATES]


def through_text(description: SessionDescription) -> SessionDescription:
    """As signalling carries it."""
    return parse_description(write_description(description))


class PeerPair:
    """`peers[0]` offers, `peers[1]` answers."""

    def __init__(self, settings: PeerSettings | None = None, seed: int = 1) -> None:
        random = Random(seed)
        self.now = 1000.0
        self.lost: Callable[[int, bytes], bool] = lambda side, data: False  # of what `peers[side]` sent
        self.peers = [
            Peer(
                CONTEXTS[side],
                CERTIFICATES[side].fingerprint,
                gather([f"192.0.2.{side + 1}"], 4000),
                controlling=side == 0,
                settings=settings,
                random=Random(random.random()),
            )
            for side in (0, 1)
        ]
        self.events: tuple[list[PeerEvent], list[PeerEvent]] = ([], [])
        self.sent: tuple[list[bytes], list[bytes]] = ([], [])
        self._flying: list[tuple[float, int, int, Datagram]] = []  # when, order, sender, what
        self._order = count()

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while True:
            self._collect()
            times = [each.timer() for each in self.peers]
            due = earliest(*times, *(each[0] for each in self._flying[:1]))
            if due is None or due > end:
                break
            self.now = max(self.now, due)
            while self._flying and self._flying[0][0] <= self.now:
                _, _, side, datagram = heapq.heappop(self._flying)
                path = Path(datagram.remote, datagram.local)
                self.peers[1 - side].receive_datagram(datagram.data, path, self.now)
            for peer, timer in zip(self.peers, times, strict=True):
                if timer is not None and timer <= self.now:
                    peer.handle_timer(self.now)
        self.now = end

    def _collect(self) -> None:
        for side, peer in enumerate(self.peers):
            self.events[side].extend(peer.events())
            self._carry(side, peer.datagrams_to_send())

    def _carry(self, side: int, datagrams: Iterable[Datagram]) -> None:
        for datagram in datagrams:
            self.sent[side].append(datagram.data)
            if not self.lost(side, datagram.data):
                heapq.heappush(self._flying, (self.now + DELAY, next(self._order), side, datagram))

    def send_frame(self, side: int, mid: str, payloads: Sequence[bytes], media_time: int, **options: Any) -> None:
        """`options`: as in `BundleMedia.frame_to_send`."""
        peer = self.peers[side]
        sent = peer.media.frame_to_send(mid, payloads, media_time, self.now, **options)
        if peer.ice.path is not None:
            self._carry(side, [Datagram(data, peer.ice.path) for data in sent])

    def open_channel(self, side: int, label: str) -> int:
        return self.peers[side].need_channels(self.now).open(label, self.now)

    def send(self, side: int, channel: int, data: str | bytes) -> None:
        self.peers[side].need_channels(self.now).send(channel, data, self.now)

    def of(self, side: int, kind: type) -> list[PeerEvent]:
        return [each for each in self.events[side] if isinstance(each, kind)]

"""Takes the driver's voice from its media section to the loudspeaker at the robot."""

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from prometheus_client import CollectorRegistry, Counter, Gauge

from lockstep.protocol.console import PEOPLE, Role, Voice
from lockstep.server.talkback.speaker import Speaker
from lockstep.server.talkback.speaker_url import SpeakerSpec
from lockstep.server.talkback.talkback_arbiter import SPEAKS_FOR, TalkbackArbiter, VoicePacket

if TYPE_CHECKING:
    from lockstep.server.peers.peer import Peer

__all__ = ["VoiceLine", "Talkback"]


class VoiceLine:
    """Passes one peer's voice to the loudspeaker. Made before the peer; takes nothing until `peer` is set."""

    def __init__(self, service: "Talkback") -> None:
        self.peer: Peer | None = None
        self._service = service

    def take(self, packet: VoicePacket) -> None:
        if self.peer is not None and not self.peer.ended:
            with self.peer.contained("voice"):
                self._service.heard(self.peer, packet)


class Talkback:
    """Plays the driver's voice at the robot. Await `run`. Without a loudspeaker nobody's voice is taken."""

    def __init__(
        self,
        spec: SpeakerSpec | None,
        holds: Callable[[str], bool],
        registry: CollectorRegistry,
        tell: Callable[[Voice], None],
    ) -> None:
        self._speaker = None if spec is None else Speaker(spec, self._speaker_changed)
        self._arbiter = TalkbackArbiter(holds)
        self._tell = tell
        self._told = Voice()
        self._timer: asyncio.TimerHandle | None = None
        self._packets = Counter(
            "lockstep_voice_packets", "Opus packets of peers, by outcome", ["outcome"], registry=registry
        )
        self._speaking = Gauge("lockstep_voice_speaking", "1 if a voice plays at the robot, else 0", registry=registry)
        self._works = Gauge("lockstep_voice_speaker_works", "1 if the loudspeaker works, else 0", registry=registry)
        self._works.set(spec is not None)

    @property
    def enabled(self) -> bool:
        return self._speaker is not None

    def line(self, role: Role) -> VoiceLine | None:
        """Return the voice line of a peer that may hold the seat; None if its voice is not taken."""
        return VoiceLine(self) if self.enabled and role in PEOPLE else None

    def state(self) -> Voice:
        return self._arbiter.state(time.monotonic())

    async def run(self) -> None:
        """Run until cancelled."""
        if self._speaker is None:
            return
        try:
            await self._speaker.run()
        finally:
            if self._timer is not None:
                self._timer.cancel()

    def heard(self, peer: "Peer", packet: VoicePacket) -> None:
        now = time.monotonic()
        outcome: str = self._arbiter.packet(peer.id, peer.name, packet, now)
        if outcome == "played" and self._speaker is not None and not self._speaker.play(packet.payload):
            outcome = "speaker_busy"
        self._packets.labels(outcome).inc()
        if self._timer is None and self._arbiter.speaks(now):
            self._look()

    def _speaker_changed(self) -> None:
        if self._speaker is not None:
            self._arbiter.trouble = self._speaker.trouble
            self._works.set(not self._speaker.trouble)
        self._announce()

    def _look(self) -> None:
        """Announce the state, repeatedly while somebody speaks."""
        self._timer = None
        self._announce()
        if self._arbiter.speaks(time.monotonic()):
            self._timer = asyncio.get_running_loop().call_later(SPEAKS_FOR / 2, self._look)

    def _announce(self) -> None:
        state = self.state()
        self._speaking.set(bool(state.peer))
        if state != self._told:
            self._told = state
            self._tell(state)

"""An established end whose peer says whatever it likes, and what must hold all the time."""

from lockstep.rtc.channels import ChannelEvent, DataChannels
from lockstep.rtc.sctp import Closed, SctpSettings, State
from lockstep.rtc.sctp.wire.chunks import Chunk, Init
from lockstep.rtc.sctp.wire.packet import decode_packet, encode_packet
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import World, seeded

__all__ = ["NAMED_ENDS", "Victim"]

NAMED_ENDS = {
    "closed",
    "aborted",
    "peer_closed",
    "peer_aborted",
    "peer_restarted",
    "receive_window_exceeded",
    "message_too_large",
    "empty_data",
    "interleaving_violated",
    "init_invalid",
}
SMALL = 8 * 1024  # bytes of receive window, so that bounds are reached soon


class Victim:
    """A DTLS server's end. The peer's tag and numbers are always the same; `tsn` is the next that the peer would use.

    `established`: after a handshake with a well-behaved peer, one channel open each way.
    """

    def __init__(self, *, established: bool = True, interleaving: bool = False) -> None:
        settings = SctpSettings(receive_window=SMALL, max_receive_message=4096, interleaving=interleaving)
        self.end = DataChannels(settings, seeded(1), client=False)
        self.now = 1.0
        self.events: list[ChannelEvent] = []
        peer = DataChannels(settings, seeded(2), client=True)
        self.end.association.start(0.0)
        if established:
            world = World(self.end, peer)
            peer.open("theirs", 0.0)
            self.end.open("ours", 0.0)
            world.run(1.0)
            assert self.end.association.state is State.ESTABLISHED
        self.tag = Internals(self.end.association).tag
        self.tsn = Internals(peer.association).next_tsn
        self.theirs = Internals(self.end.association).next_tsn

    def say(self, *chunks: Chunk) -> list[bytes]:
        """What it sends after a packet of these."""
        tag = 0 if isinstance(chunks[0], Init) and len(chunks) == 1 else self.tag
        return self.hear(encode_packet(5000, 5000, tag, b"".join(chunk.encode() for chunk in chunks)))

    def say_raw(self, chunks: bytes) -> list[bytes]:
        return self.hear(encode_packet(5000, 5000, self.tag, chunks))

    def hear(self, packet: bytes) -> list[bytes]:
        self.end.receive_packet(packet, self.now)
        return self._check()

    def wait(self, seconds: float) -> list[bytes]:
        self.now += seconds
        sent = self._check()
        for _ in range(20):
            due = self.end.timer()
            if due is None or due > self.now:
                break
            self.end.handle_timer(self.now)
            sent += self._check()
        else:
            raise AssertionError("the timer stands still")
        return sent

    def _check(self) -> list[bytes]:
        association, inside = self.end.association, Internals(self.end.association)
        packets = self.end.packets_to_send()
        for packet in packets:
            assert len(packet) <= association.settings.max_packet, len(packet)
            decode_packet(packet)
        assert len(packets) <= 40, "more in return than a window"
        assert inside.held <= 2 * SMALL + 4096 + 2000
        assert inside.fragments <= 1000
        assert inside.runs <= association.settings.max_gaps + 1
        assert inside.control_chunks <= 100
        assert len(self.end._channels) <= 64
        events = self.end.events()
        for event in events:
            assert not isinstance(event, Closed) or event.reason in NAMED_ENDS, event
        self.events += events
        return packets

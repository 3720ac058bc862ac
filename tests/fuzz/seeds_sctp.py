"""Writes the inputs that fuzzing SCTP begins with: `python -m tests.fuzz.seeds_sctp`."""

from pathlib import Path

from lockstep.rtc.dcep import ACK, Open, Reliability
from lockstep.rtc.sctp.wire.chunks import (
    BEGIN,
    END,
    IMMEDIATE,
    UNORDERED,
    Abort,
    Chunk,
    CookieAck,
    CookieEcho,
    Data,
    Error,
    ForwardTsn,
    Heartbeat,
    HeartbeatAck,
    Init,
    InitAck,
    InterleavedData,
    InterleavedForwardTsn,
    Reconfig,
    Sack,
    Shutdown,
    ShutdownAck,
    ShutdownComplete,
    Skip,
    Unknown,
)
from tests.fuzz.parsers.sctp import SCENES, pack
from tests.rtc.sctp.hostile import Victim
from tests.rtc.sctp.internals import Internals

__all__ = ["CORPUS", "seeds"]

CORPUS = Path(__file__).parent / "corpus" / "sctp"
WHOLE = BEGIN | END


def packet(*chunks: Chunk) -> bytes:
    return b"".join(chunk.encode() for chunk in chunks)


def reset(number: int, last: int, *streams: int) -> Reconfig:
    body = b"".join(value.to_bytes(4, "big") for value in (number, 0, last & 0xFFFFFFFF))
    return Reconfig([(13, body + b"".join(stream.to_bytes(2, "big") for stream in streams))])


def seeds() -> dict[str, bytes]:
    """Packets that a peer could send, by name; without the byte that chooses the scene."""
    victim = Victim()
    tsn, own, first = victim.tsn, victim.theirs, Internals(victim.end.association).cumulative
    init = Init(77, 9000, 10, 10, 5, [(0xC000, b""), (0x8008, b"\x82\xc0\x40\xc2"), (0xC123, b"?")])
    opening = Open("a", "b", Reliability(False, 0)).encode()
    made: dict[str, list[bytes]] = {
        "text": [packet(Data(tsn, WHOLE, 0, 1, 51, b"text"), Data(tsn + 1, WHOLE | UNORDERED, 0, 0, 53, b"\0"))],
        "fragments": [
            packet(Data(tsn + 2, END, 0, 1, 51, b"end")),
            packet(Data(tsn, BEGIN, 0, 1, 51, b"begin"), Data(tsn + 1, IMMEDIATE, 0, 1, 51, b"middle")),
        ],
        "interleaved": [
            packet(InterleavedData(tsn, BEGIN, 0, 1, 0, 51, b"a"), InterleavedData(tsn + 1, BEGIN, 2, 0, 0, 50, b"b")),
            packet(
                InterleavedData(tsn + 2, END, 0, 1, 1, 51, b"c"), InterleavedForwardTsn(tsn + 5, [Skip(0, 3, True)])
            ),
        ],
        "forward": [packet(Data(tsn + 1, WHOLE, 0, 2, 51, b"x")), packet(ForwardTsn(tsn, [Skip(0, 1), Skip(9, 9)]))],
        "sacks": [packet(Sack(own - 1, 9000, [(2, 3), (5, 4)], [own, own])), packet(Sack(own + 9, 0))],
        "open": [packet(Data(tsn, WHOLE, 2, 0, 50, opening)), packet(Data(tsn + 1, WHOLE, 1, 0, 50, ACK))],
        "reset": [packet(reset(tsn, tsn - 1, 0, 1)), packet(reset(tsn + 1, tsn + 5)), packet(reset(first, first))],
        "other-reconfig": [packet(Reconfig([(14, bytes(8)), (15, bytes(4)), (16, bytes(8)), (17, bytes(8))]))],
        "handshake": [packet(init), packet(InitAck(78, 9000, 1, 1, 1, [(7, b"cookie")])), packet(CookieAck())],
        "cookie": [packet(CookieEcho(bytes(44)), Data(tsn, WHOLE, 0, 1, 51, b"x"))],
        "heartbeats": [packet(Heartbeat(b"\0\1\0\x0cabcdefgh"), HeartbeatAck(b"\0\1\0\x0c" + bytes(8)))],
        "shutdown": [packet(Shutdown(own - 1)), packet(ShutdownAck()), packet(ShutdownComplete())],
        "abort": [packet(Abort([(12, b"bye")], reflected=True)), packet(Abort([(12, b"bye")]))],
        "errors": [packet(Error([(3, bytes(4)), (1, b"\0\1\0\0")]), Unknown(77, 1, b"?"), Unknown(200, 1, b"?"))],
        "holes": [packet(*(Data(tsn + 2 * index, WHOLE | UNORDERED, 0, 0, 51, b"x") for index in range(60)))],
        "nothing": [b"", b"\0", b"\0\0\0\4"],
    }
    return {name: pack(packets) for name, packets in made.items()}


def main() -> None:
    CORPUS.mkdir(parents=True, exist_ok=True)
    for name, data in seeds().items():
        for scene in range(len(SCENES)):
            (CORPUS / f"{name}-{scene}").write_bytes(bytes([scene]) + data)


if __name__ == "__main__":
    main()

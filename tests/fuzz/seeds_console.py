"""Writes the inputs that fuzzing WHEP and the data channels begins with: `python -m tests.fuzz.seeds_console`.

Inputs that once broke something are added to the corpus by hand and stay.
"""

import json
from pathlib import Path

import msgspec

from lockstep.protocol.actions import Act, ActionCancel
from lockstep.protocol.console import (
    ClientMessage,
    Rename,
    Report,
    SeatRelease,
    SeatRequest,
    StreamReport,
    encode_console_message,
)
from lockstep.protocol.messages import Command, Ping, Reset, Rest, Stop
from tests.server.offers import offer, section

__all__ = ["channel_seeds", "sdp_seeds", "write"]

CORPUS = Path(__file__).parent / "corpus"
HOST = "a=candidate:1 1 udp 2130706431 192.0.2.7 5000 typ host\r\n"
LOCAL = "a=candidate:2 1 udp 2113937151 0f9e8d7c-0000-4000-8000-000000000000.local 5001 typ host generation 0\r\n"
RELAY = "a=candidate:3 1 udp 41885439 198.51.100.9 50000 typ relay raddr 0.0.0.0 rport 0 generation 0\r\n"
EXTENSIONS = (
    "a=extmap:1 urn:x-lockstep:rtp-hdrext:event-reference\r\n"
    "a=extmap:2 http://www.webrtc.org/experiments/rtp-hdrext/abs-capture-time\r\n"
    "a=extmap:3/sendrecv http://www.webrtc.org/experiments/rtp-hdrext/playout-delay\r\n"
)
CODECS = (
    "a=rtpmap:97 rtx/90000\r\na=fmtp:97 apt=96\r\na=rtcp-fb:96 nack pli\r\na=rtcp-fb:96 goog-remb\r\n"
    "a=rtpmap:102 H264/90000\r\n"
    "a=fmtp:102 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n"
)


def sdp_seeds() -> dict[str, bytes]:
    """Text, by name; without the byte that chooses the scene."""
    video = section("0", extra=EXTENSIONS, candidate=HOST)
    full = offer(video, section("1", "audio", EXTENSIONS), section("2", "application"))
    many = offer(*[section(str(number)) for number in range(41)])
    restart = f"a=ice-ufrag:Zz/+\r\na=ice-pwd:{'x' * 22}\r\nm=video 9 UDP/TLS/RTP/SAVPF 0\r\na=mid:0\r\n{HOST}{RELAY}"
    texts = {
        "one-video": offer(video),
        "everything": full,
        "codecs": offer(section("0", extra=CODECS).replace("SAVPF 96", "SAVPF 96 97 102")),
        "mdns": offer(section("0", candidate=LOCAL + "a=end-of-candidates\r\n")),
        "relay": offer(section("0", candidate=RELAY)),
        "only-data": offer(section("0", "application")),
        "message-size": offer(section("0", "application", "a=max-message-size:0\r\n")),
        "message-size-huge": offer(section("0", "application", f"a=max-message-size:{2**64}\r\n")),
        "sctp-port": offer(section("0", "application").replace("a=sctp-port:5000", "a=sctp-port:70000")),
        "old-sctp": offer(
            section("0", "application").replace("a=sctp-port:5000", "a=sctpmap:5000 webrtc-datachannel 1024")
        ),
        "too-many-sections": many,
        "no-bundle": offer(video, bundle=""),
        "other-bundle": offer(video, bundle="0 1 2"),
        "same-mid": offer(video, section("0", "audio")),
        "directions": offer(video.replace("recvonly", "sendrecv"), section("1").replace("recvonly", "inactive")),
        "extension-ids": offer(section("0", extra=EXTENSIONS.replace("extmap:2", "extmap:1"))),
        "extension-id-0": offer(section("0", extra=EXTENSIONS.replace("extmap:1 ", "extmap:0 "))),
        "extension-id-huge": offer(section("0", extra=EXTENSIONS.replace("extmap:1 ", "extmap:99999999999 "))),
        "ice-lite": full.replace("t=0 0\r\n", "t=0 0\r\na=ice-lite\r\n"),
        "ice-options": full.replace("t=0 0\r\n", "t=0 0\r\na=ice-options:trickle renomination\r\n"),
        "setup-active": full.replace("actpass", "active"),
        "setup-nonsense": full.replace("actpass", "sleepy"),
        "fingerprint": full.replace("sha-256 AB", "md5 AB"),
        "port-0": full.replace("m=video 9", "m=video 0"),
        "newlines": full.replace("\r\n", "\n"),
        "carriage-returns": full.replace("\r\n", "\r"),
        "long-line": "v=0\r\n" + "a=" + "x" * 5000 + "\r\n",
        "unicode": full.replace("s=-", "s=\u202e\u2028\u0000\ud7ff"),
        "fragment": f"a=ice-ufrag:abcd\r\na=ice-pwd:{'y' * 24}\r\n{HOST}{LOCAL}a=end-of-candidates\r\n",
        "restart": restart,
        "restart-two-passwords": restart + f"a=ice-pwd:{'z' * 22}\r\n",
        "candidate-short": "a=candidate:1 1 udp\r\n",
        "candidate-tcp": HOST.replace("udp", "tcp").replace("\r\n", " tcptype active\r\n"),
        "candidate-ipv6": HOST.replace("192.0.2.7", "2001:db8::7"),
        "candidate-scope": HOST.replace("192.0.2.7", "fe80::1%eth0"),
        "candidate-name": HOST.replace("192.0.2.7", "robot.example"),
        "candidate-huge": HOST.replace("2130706431", str(2**70)).replace("5000", "99999"),
        "candidates-101": HOST * 101,
        "nothing": "",
    }
    return {name: text.encode(errors="replace") for name, text in texts.items()}


def channel_seeds() -> dict[str, bytes]:
    """What arrives, by name; without the byte that chooses the channel."""
    report = Report(
        event=5, armed=True, streams=[StreamReport(stream="overview", carrier="native", gap=1, stamp=4)] * 3
    )
    messages: dict[str, ClientMessage] = {
        "command": Command(event=2, issue=1, values=[0.1, -0.2, 0.0]),
        "command-goals": Command(event=2, issue=1, values=[0.1, None, -1.5], speed=0.25),
        "rest": Rest(event=2),
        "ping": Ping(id=7),
        "report": report,
        "stop": Stop(by="ann", reason="dog"),
        "reset": Reset(by="ann"),
        "seat-request": SeatRequest(),
        "seat-release": SeatRelease(),
        "rename": Rename(name="Ann"),
        "act": Act(id="5f", name="light", parameters={"on": True, "level": 0.5, "mode": "low"}, nonce=7),
        "action-cancel": ActionCancel(id="5f"),
    }
    texts: dict[str, object] = {
        "huge-event": {"type": "command", "event": 2**64, "issue": 1, "values": []},
        "negative-event": {"type": "rest", "event": -1},
        "values-wrong": {"type": "command", "event": 2, "issue": 1, "values": [None, "1", {}]},
        "values-many": {"type": "command", "event": 2, "issue": 1, "values": [0.5] * 1000},
        "unknown": {"type": "jump", "height": 3},
        "no-type": {"id": 1},
        "type-number": {"type": 7},
        "extra": {"type": "ping", "id": 1, "more": {"x": [1]}},
        "long-name": {"type": "rename", "name": "\u202e" * 3000},
        "list": [1, 2, 3],
        "null": None,
        "act-many": {"type": "act", "id": "x", "name": "home", "parameters": {f"p{n}": n for n in range(9)}},
        "act-deep": {"type": "act", "id": "x" * 65, "name": "", "parameters": {"a": [{}], "": 1e999}},
    }
    raw = {
        "not-json": b"hello",
        "half": b'{"type":"ping","id":',
        "two": b'{"type":"ping","id":1}{"type":"ping","id":2}',
        "numbers": b'{"type":"command","event":2,"issue":1,"values":[1e999,-1e999,NaN,Infinity]}',
        "repeated-key": b'{"type":"ping","type":"stop","id":1,"by":"","reason":""}',
        "deep": b"[" * 2000,
        "long": b'{"type":"stop","reason":"' + b"x" * 16_300 + b'"}',
        "bad-utf8": b'{"type":"rename","name":"\xff\xfe\xed\xa0\x80"}',
        "surrogates": b'{"type":"rename","name":"\\ud800"}',
        "zero": b"\0",
        "nothing": b"",
        "label": b"control",
        "label-long": b"control" * 100,
        "camera": msgspec.msgpack.encode({"type": "ViewerCameraMessage", "position": [1.0, 2.0, 3.0]}),
        "tunnel": msgspec.msgpack.encode({"type": "ShareUrlRequest"}),
        "msgpack-deep": b"\x91" * 3000,
    }
    found = {name: encode_console_message(each).encode() for name, each in messages.items()}
    return found | {name: json.dumps(each).encode() for name, each in texts.items()} | raw


def write() -> None:
    """Every seed in every scene."""
    for folder, seeds, codes in (("sdp", sdp_seeds(), range(3)), ("channels", channel_seeds(), (0, 1, 2, 128, 3, 4))):
        (CORPUS / folder).mkdir(parents=True, exist_ok=True)
        for name, data in seeds.items():
            for code in codes:
                (CORPUS / folder / f"{name}-{code}").write_bytes(bytes([code]) + data)


if __name__ == "__main__":
    write()

"""Writes the inputs that fuzzing the robot link begins with: `python -m tests.fuzz.seeds`.

Inputs that once broke something are added to the corpus by hand and stay.
"""

from pathlib import Path

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, Status, StatusItem
from lockstep.protocol.framing import frame
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import (
    Challenge,
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    Media,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    Stop,
    encode_message,
)
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

__all__ = ["CORPUS", "seeds"]

CORPUS = Path(__file__).parent / "corpus" / "robot_link"
SCENES, CUTS = 5, 5
NONCE = bytes(range(32))
PROOF = LinkSecret("another secret than the one that is asked for").client_proof(NONCE, NONCE, "operator")


def wire(*messages: LinkMessage) -> bytes:
    return b"".join(frame(encode_message(message)) for message in messages)


def raw(value: object) -> bytes:
    return frame(msgspec.msgpack.encode(value))


def commands(*values: list[float], first: int = 2) -> bytes:
    return wire(*(Command(event=first + number, issue=1, values=each) for number, each in enumerate(values)))


def seeds() -> dict[str, bytes]:
    """What arrives, by name; without the byte that chooses the scene."""
    moving = [0.4, -0.2, 0.5]
    hello = wire(Hello(role="operator", name="fuzz"))
    deep: object = []
    for _ in range(600):
        deep = [deep]
    return {
        "hello-operator": hello + commands(moving, moving),
        "hello-events": wire(Hello(role="events"), Stop(by="x", reason="y")),
        "hello-media": wire(Hello(role="media"), Ping(id=1), Pong(id=2)),
        "hello-robot": wire(Hello(role="robot", epoch="e", description=DESCRIPTION)),
        "hello-with-nonce": wire(Hello(role="operator", nonce=NONCE), Hello(role="operator", nonce=NONCE, proof=PROOF)),
        "hello-twice": hello + hello,
        "hello-other-version": raw({"type": "hello", "version": 1, "role": "operator"}),
        "challenge": wire(Challenge(nonce=NONCE), Hello(role="robot", epoch="e", proof=PROOF)),
        "drive-and-let-go": commands(moving, moving) + wire(Rest(event=3)) + commands([0.0] * 3, first=4),
        "every-event-at-once": commands(*[moving] * 12),
        "repeats": commands(moving) * 6,
        "out-of-range": commands([1e300, -1e300, 1e9]),
        "not-numbers": commands([float("nan"), float("inf"), float("-inf")]),
        "wrong-sizes": commands([], [1.0], [0.1] * 256),
        "far-events": wire(Command(event=2**31 - 1, issue=2**60, values=moving), Rest(event=2**31 - 1)),
        "stop-reset-stop": wire(Stop(by="a"), Reset(by="b"), Stop(by="c")) + commands(moving),
        "feedback": wire(Feedback(event=5, issue=1, time=1.0, axes=moving), EventNotice(event=6, time=2.0)),
        "refusal-goodbye": wire(Refusal(event=5, reason="late", current=4), Goodbye(error="closing")),
        "media": wire(Media(stream="overview", codec="mjpeg", stamp=3, time=1.0, payload=b"\xff\xd8\xff\xd9")),
        "unknown-kind": raw({"type": "jump", "height": 3}),
        "wrong-types": raw({"type": "command", "event": "2", "issue": None, "values": {}}),
        "unknown-fields": raw({"type": "ping", "id": 1, "more": [1, {"x": b"\0"}]}),
        "not-a-map": raw([1, 2, 3]) + raw(7) + raw("hello"),
        "huge-numbers": raw({"type": "ping", "id": 2**64 - 1}) + raw({"type": "rest", "event": -1}),
        "deeply-nested": raw(deep),
        "bad-utf8": frame(b"\x82\xa4type\xa4stop\xa2by\xa2\xff\xfe"),
        "length-zero": b"\0\0\0\0",
        "length-too-long": b"\xff\xff\xff\xff",
        "length-at-the-bound": (1 << 20).to_bytes(4, "big") + b"\x81",
        "long-frame": (12_000).to_bytes(4, "big") + bytes(12_000),
        "cut-short": hello[:-3],
        "http": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
        "tls": bytes.fromhex("1603010200010001fc0303") + NONCE,
        "nothing": b"",
        "zz-actions": hello
        + wire(
            Act(id="5f", name="home", nonce=7),
            Act(id="60", name="light", parameters={"on": True}, nonce=7),
            Command(event=2, issue=1, values=[0.0] * 3, action="5f"),
            ActionCancel(id="5f"),
            ActionCancel(),
        ),
        "zz-status": wire(
            ActionUpdate(id="5f", name="home", state="running", progress=0.5, event=3, moves=True),
            Status(event=3, items=[StatusItem(name="battery", label="Battery", kind="battery", value=0.5)]),
        ),
    }


def main() -> None:
    CORPUS.mkdir(parents=True, exist_ok=True)
    for number, (name, data) in enumerate(sorted(seeds().items())):
        for scene in range(SCENES):
            code = scene + SCENES * ((number + scene) % CUTS)
            (CORPUS / f"{name}-{scene}").write_bytes(bytes([code]) + data)


if __name__ == "__main__":
    main()

"""A bridge that keeps the protocol and says what no robot could: the console counts it and has no fault of its own."""

import asyncio
import contextlib
import math
import random
from collections.abc import Iterator
from typing import get_args

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import (
    Feedback,
    Hello,
    LinkMessage,
    Media,
    MediaCodec,
    Ping,
    Refusal,
    RefusalReason,
    StopState,
    StopTaken,
    decode_message,
    encode_message,
)
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.server.rig import eventually, running_console

COUNT = 300  # messages on each link
LAST = 12_345  # number of the stop that the last of them takes
NUMBERS = [0.0, -1.0, 1e-320, 1e12, -1e12, 1e308, math.inf, math.nan]
TEXTS = ["", "a", "\x1b[2J\n", "\u202e", "x" * 500, "../..", "<b>"]
WHOLE = [0, 1, 7, 2**31, 2**53 - 1]
BODIES = [b"", b"\xff\xd8\xff", b"\0\0\0\1\x67\0", b"\0\0\0\1\x65\xff", bytes(64 * 64 * 3 // 2), bytes(100_000)]


def _said_to_an_operator(choose: random.Random) -> Iterator[LinkMessage]:
    for _ in range(COUNT):
        stop = StopState(
            stopped=choose.random() < 0.5,
            by=choose.choice(TEXTS),
            number=choose.choice(WHOLE),
            locked_out=choose.choice(TEXTS),
        )
        yield Feedback(
            event=choose.choice([1, 2, 2**30, 2**31 - 1]),
            issue=choose.choice([1, 2, 2**53 - 1]),
            time=choose.choice(NUMBERS),
            axes=choose.choices(NUMBERS[:5], k=len(DESCRIPTION.axes)),
            joints=choose.choices(NUMBERS[:5], k=len(DESCRIPTION.joints)),
            stop=stop,
            faults=TEXTS,
            limits=TEXTS,
            unknown=TEXTS,
            warning=choose.choice(NUMBERS),
        )
        reason: RefusalReason = choose.choice(get_args(RefusalReason))
        yield Refusal(event=choose.choice([0, 2]), reason=reason, current=1, detail=choose.choice(TEXTS))
        yield StopTaken(press=choose.choice(["", "f" * 32, "x" * 64]), number=choose.choice(WHOLE))


def _shown(choose: random.Random) -> Iterator[LinkMessage]:
    streams = [each.name for each in DESCRIPTION.cameras] + [each.name for each in DESCRIPTION.microphones]
    for _ in range(COUNT):
        codec: MediaCodec = choose.choice(get_args(MediaCodec))
        yield Media(
            stream=choose.choice([*streams, "none"]),
            codec=codec,
            stamp=choose.choice([1, 2**30, 2**31 - 1]),
            time=choose.choice(NUMBERS),
            payload=choose.choice(BODIES),
            width=choose.choice([0, 64, 8192]),
            height=choose.choice([0, 64, 8192]),
            sample_rate=choose.choice([0, 8000, 192_000]),
            channels=choose.choice([0, 1, 2, 8]),
            keyframe=choose.random() < 0.5,
        )


async def _bridge(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    length = int.from_bytes(await reader.readexactly(4), "big")
    hello = decode_message(await reader.readexactly(length))
    assert isinstance(hello, Hello)
    choose = random.Random(5)
    said = _said_to_an_operator(choose) if hello.role == "operator" else _shown(choose)
    with contextlib.suppress(ConnectionError):
        writer.write(frame(encode_message(Hello(role="robot", epoch="e", description=DESCRIPTION))))
        for message in (*said, StopTaken(press="end", number=LAST)):
            writer.write(frame(encode_message(message)))
            await writer.drain()
        number = 0
        while not writer.is_closing():
            number += 1
            writer.write(frame(encode_message(Ping(id=number))))
            await writer.drain()
            await asyncio.sleep(0.1)


async def test_whatever_a_bridge_says_the_console_has_no_fault_and_keeps_the_link() -> None:
    bridge = await asyncio.start_server(_bridge, "127.0.0.1", 0)
    async with bridge, running_console(bridge.sockets[0].getsockname()[1]) as rig:
        answer = await rig.http.post("/api/recordings", headers=rig.token("operator"), json={})
        console = rig.dependencies.console
        ended: list[int] = []
        take = console.link_message_received

        def heard(message: LinkMessage) -> None:
            take(message)
            if isinstance(message, StopTaken):
                ended.append(message.number)

        console.link_message_received = heard  # type: ignore[method-assign]
        await eventually(lambda: ended.count(LAST) == 2)
        assert answer.status_code in (201, 409), answer.text
        assert console.robot.up
        assert console.robot.bad_input()["malformed"] > 0
        assert rig.count("lockstep_robot_link_losses_total") == 0
        for sample in (
            each for metric in rig.dependencies.metrics.internal_errors.collect() for each in metric.samples
        ):
            assert not sample.name.endswith("_total") or sample.value == 0, sample

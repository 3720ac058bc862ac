"""docs/robot-link.md tells the truth: its bytes decode, its names are all there is."""

import asyncio
import re
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from lockstep.protocol import description
from lockstep.protocol.framing import MAX_CONTROL_FRAME, MAX_HELLO_FRAME, MAX_MEDIA_FRAME, FrameReader, frame
from lockstep.protocol.link_secret import MIN_SECRET_BYTES
from lockstep.protocol.messages import (
    Command,
    Feedback,
    Hello,
    LinkMessage,
    LinkMessageOnWire,
    MediaCodec,
    Ping,
    Refusal,
    RefusalReason,
    Rest,
    StopState,
    decode_message,
    encode_message,
)
from lockstep.robot_bridge.link.admission.link_acceptor import RATE
from lockstep.robot_bridge.link.heartbeats import PING_INTERVAL, SILENCE
from lockstep.robot_bridge.link.link_server import OPERATOR_READ_RATE, READ_BURST, READ_RATE
from lockstep.robot_bridge.link.link_session import (
    FROM_CLIENT,
    FROM_ROBOT,
    HELLO_TIMEOUT,
    kind_of,
)
from lockstep.robot_bridge.link.sending.outgoing_queues import ORDERED_DEPTH
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.watchdog.liveness import ALARM, EXIT_HUNG, LIMIT
from tests.robot_bridge.bridge_helpers import running_bridge

TEXT = (Path(__file__).parents[2] / "docs" / "robot-link.md").read_text()
KINDS: tuple[type[msgspec.Struct], ...] = get_args(LinkMessageOnWire)

EXAMPLE: list[LinkMessage] = [
    Hello(role="operator", name="demo"),
    Ping(id=1),
    Command(event=2, issue=1, values=[0.5, 0.0, -0.25], nonce=4503599627370497),
    Feedback(event=2, issue=1, time=12.5, axes=[0.5, 0.0, -0.25], at_rest=False, nonce=42),
    Refusal(event=2, reason="late", current=1),
    Rest(event=3),
]


def section(title: str) -> str:
    """The text from a heading to the next one of its level or above."""
    match = re.search(rf"^(#+) {re.escape(title)}.*?$", TEXT, re.MULTILINE)
    assert match is not None, f"no section {title}"
    following = re.search(rf"^#{{1,{len(match[1])}}} ", TEXT[match.end() :], re.MULTILINE)
    return TEXT[match.end() : match.end() + following.start() if following else None]


def fenced(language: str) -> str:
    match = re.search(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    assert match is not None
    return match[1]


def first_column(table: str) -> set[str]:
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    return set(re.findall(r"`(\w+)`", " ".join(rows)))


def test_the_example_bytes_are_the_messages_that_the_text_says() -> None:
    digits = "".join(line for line in fenced("hex").splitlines() if not line.startswith("#"))
    reader = FrameReader(MAX_CONTROL_FRAME)
    reader.feed(bytes.fromhex(digits))
    payloads = list(reader.frames())
    reader.at_end()
    assert [decode_message(payload) for payload in payloads] == EXAMPLE
    assert bytes.fromhex(digits) == b"".join(frame(encode_message(message)) for message in EXAMPLE)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_message_is_described_with_all_its_fields(kind: type[msgspec.Struct]) -> None:
    name = str(kind.__struct_config__.tag)
    title = "ping and pong" if name in ("ping", "pong") else f"{name}, "
    assert first_column(section(title)) == {"type", *kind.__struct_fields__}
    assert f'`"{name}"`' in section(title)


@pytest.mark.parametrize(
    "kind", [getattr(description, name) for name in description.__all__], ids=lambda kind: str(kind)
)
def test_every_field_of_the_description_is_described(kind: object) -> None:
    text = section("The robot description")
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        assert all(f"`{name}`" in text for name in kind.__struct_fields__)
    else:
        assert all(f"`{value}`" in text for value in get_args(kind))


def test_the_refusal_reasons_are_all_described() -> None:
    console_only = {"no_seat", "seat_taken", "declined", "silenced", "too_often", "link_down"}
    assert first_column(section("Refusals")) == set(get_args(RefusalReason)) - console_only
    assert all(f"`{reason}`" in section("Refusals") for reason in console_only)


def test_the_roles_are_all_described() -> None:
    rows = [line for line in section("Handshake and roles").splitlines() if line.startswith("| `")]
    roles = {}
    for row in rows:
        role, sends, receives = (set(re.findall(r"`(\w+)`", cell)) for cell in row.split("|")[1:4])
        roles[role.pop()] = (sends, receives)
    assert roles == {
        role: ({tag(kind) for kind in FROM_CLIENT[role]}, {tag(kind) for kind in FROM_ROBOT[role]})
        for role in FROM_CLIENT
    }


def tag(kind: type[LinkMessage]) -> str:
    return str(kind.__struct_config__.tag)


def test_the_numbers_are_those_of_the_code() -> None:
    assert "1 048 576" in TEXT
    assert MAX_CONTROL_FRAME == 1_048_576
    assert "16 777 216" in TEXT
    assert MAX_MEDIA_FRAME == 16_777_216
    assert f"every {PING_INTERVAL:g} s" in TEXT
    assert f"valid for {SILENCE:.1f} s" in TEXT
    assert f"hello within {HELLO_TIMEOUT:g} s" in TEXT
    assert f"up to {ORDERED_DEPTH} messages" in TEXT
    assert f"({BridgeSettings().max_links} unless configured)" in TEXT
    assert f"at most {BridgeSettings().max_strangers} connections (unless configured)" in TEXT
    assert f"({MAX_HELLO_FRAME} bytes)" in TEXT
    assert f"{RATE:g} connections a second" in TEXT
    assert f"{READ_RATE:g} messages a second of a link ({OPERATOR_READ_RATE:g} of the operator link)" in TEXT
    assert f"{READ_BURST:g} of them at once" in TEXT
    assert f"no tick came for {LIMIT:g} s" in TEXT
    assert f"after {ALARM * LIMIT:g} s" in TEXT
    assert f"exit code {EXIT_HUNG}" in TEXT
    assert f"at least {MIN_SECRET_BYTES} bytes" in TEXT
    assert all(f"`{codec}`" in TEXT for codec in get_args(MediaCodec))
    assert first_column(section("goodbye, both ways")) == {"type", "error", "detail"}
    assert all(f"`{name}`" in section("feedback, bridge to operator") for name in StopState.__struct_fields__)
    assert kind_of(Ping(id=1)) == "ping"


async def test_the_python_example_runs() -> None:
    code = fenced("python").replace("asyncio.run(main())", "")
    async with running_bridge() as bridge:
        names: dict[str, object] = {}
        exec(compile(code.replace("5600", str(bridge.address[1])), "docs/robot-link.md", "exec"), names)
        main = names["main"]
        assert callable(main)
        driving = asyncio.ensure_future(main())
        async with asyncio.timeout(20):
            while bridge.counters.executed < 5:
                await asyncio.wait([driving], timeout=0.02)
                assert not driving.done(), driving.exception()
        driving.cancel()
        await asyncio.wait([driving])

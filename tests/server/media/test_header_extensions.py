import pytest
from aiortc.rtp import unpack_header_extensions

from robot_bridge.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    PLAYOUT_DELAY_URI,
    Carrier,
    pack_capture_time,
    unpack_capture_time,
    unpack_event_reference,
)
from server.media.header_extensions import ABS_SEND_TIME_URI, MID_URI, ExtensionWriter, choose_carrier, wanted_uris


def read(block: bytes) -> dict[int, bytes]:
    assert len(block) % 4 == 0
    assert int.from_bytes(block[2:4], "big") * 4 == len(block) - 4
    return dict(unpack_header_extensions(int.from_bytes(block[:2], "big"), block[4:]))


@pytest.mark.parametrize(
    ("uris", "trailer", "carrier"),
    [
        ((), False, "none"),
        ((), True, "trailer"),
        ((EVENT_REFERENCE_URI, CAPTURE_TIME_URI), False, "native"),
        ((CAPTURE_TIME_URI,), False, "capture-time"),
        ((EVENT_REFERENCE_URI, CAPTURE_TIME_URI), True, "trailer"),
    ],
)
def test_the_offer_decides_the_carrier(uris: tuple[str, ...], trailer: bool, carrier: Carrier) -> None:
    assert choose_carrier(dict.fromkeys(uris, 1), trailer) == carrier


def test_only_video_gets_playout_delay_and_send_time() -> None:
    assert wanted_uris("audio", "native") == (MID_URI, EVENT_REFERENCE_URI)
    assert set(wanted_uris("video", "trailer")) == {MID_URI, ABS_SEND_TIME_URI, PLAYOUT_DELAY_URI}
    assert CAPTURE_TIME_URI in wanted_uris("audio", "capture-time")
    assert wanted_uris("audio", "none") == (MID_URI,)


@pytest.mark.parametrize("identifiers", [(1, 2, 3, 4, 5), (1, 2, 3, 14, 15), (200, 201, 202, 203, 255)])
def test_all_values_are_read_back_in_the_one_byte_and_the_two_byte_form(identifiers: tuple[int, ...]) -> None:
    uris = (MID_URI, EVENT_REFERENCE_URI, CAPTURE_TIME_URI, ABS_SEND_TIME_URI, PLAYOUT_DELAY_URI)
    ids = dict(zip(uris, identifiers, strict=True))
    values = read(ExtensionWriter(ids, "video0").block(77, 1_790_000_000.25, 1_790_000_000.5))
    assert values[ids[MID_URI]] == b"video0"
    assert unpack_event_reference(values[ids[EVENT_REFERENCE_URI]]) == 77
    assert unpack_capture_time(values[ids[CAPTURE_TIME_URI]]) == 77
    assert values[ids[CAPTURE_TIME_URI]] == pack_capture_time(77, 1_790_000_000.25)
    assert values[ids[ABS_SEND_TIME_URI]] == ((1_790_000_000 % 64 << 18) + (1 << 17)).to_bytes(3, "big")
    assert values[ids[PLAYOUT_DELAY_URI]] == b"\x00\x00\x00"


def test_nothing_negotiated_is_no_block_at_all() -> None:
    assert ExtensionWriter({}, "0").block(1, 0.0, 0.0) == b""


@pytest.mark.parametrize("mid", ["", "x" * 17])
def test_a_mid_that_does_not_fit_is_left_out(mid: str) -> None:
    assert ExtensionWriter({MID_URI: 1}, mid).block(1, 0.0, 0.0) == b""


@pytest.mark.parametrize("number", [0, -1, 256, 4096])
def test_an_id_that_fits_no_packet_is_refused_before_the_first_one(number: int) -> None:
    with pytest.raises(ValueError, match="1 to 255"):
        ExtensionWriter({EVENT_REFERENCE_URI: number}, "0")

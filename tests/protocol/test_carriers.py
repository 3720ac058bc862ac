import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.carriers import (
    TRAILER_LENGTH,
    Trailer,
    append_trailer,
    pack_capture_time,
    pack_event_reference,
    pack_playout_delay,
    split_trailer,
    unpack_capture_moment,
    unpack_capture_time,
    unpack_event_reference,
)
from lockstep.protocol.serial import MAX_EVENT
from tests.protocol.strategies import events, mutated


@given(events)
def test_the_native_extension_is_the_reference_in_4_big_endian_bytes(event: int) -> None:
    assert pack_event_reference(event) == event.to_bytes(4, "big")
    assert unpack_event_reference(pack_event_reference(event)) == event


@pytest.mark.parametrize("value", [b"", b"\0\0\0", b"\0\0\0\0", b"\x80\0\0\0", b"\0\0\0\0\1"])
def test_a_native_extension_that_is_no_reference_reads_as_none(value: bytes) -> None:
    assert unpack_event_reference(value) is None


@given(events, st.floats(0, 4e9))
def test_capture_time_carries_the_reference_as_whole_seconds_of_the_offset(event: int, time: float) -> None:
    value = pack_capture_time(event, time)
    assert len(value) == 16
    assert unpack_capture_time(value) == event


def test_capture_time_is_ntp_time_and_a_signed_offset() -> None:
    assert pack_capture_time(5, 0.5).hex() == "83aa7e8080000000" + "0000000500000000"


@pytest.mark.parametrize(
    "value",
    [b"", bytes(8), bytes(16), bytes(8) + b"\0\0\0\5\0\0\0\1", bytes(8) + b"\xff" * 4 + bytes(4), bytes(17)],
)
def test_an_offset_that_is_no_reference_reads_as_none(value: bytes) -> None:
    assert unpack_capture_time(value) is None


@given(events, st.floats(0, 2e9))
def test_the_moment_of_capture_comes_back(event: int, time: float) -> None:
    assert unpack_capture_moment(pack_capture_time(event, time)) == pytest.approx(time, abs=1e-6)


@pytest.mark.parametrize("value", [b"", bytes(4), bytes(17)])
def test_an_extension_of_another_length_is_no_moment_of_capture(value: bytes) -> None:
    assert unpack_capture_moment(value) is None


def test_playout_delay_is_two_12_bit_numbers_of_10_ms() -> None:
    assert pack_playout_delay() == b"\0\0\0"
    assert pack_playout_delay(100, 40_950) == bytes([0x00, 0xAF, 0xFF])


@given(st.binary(max_size=100), events, st.integers(0, 2**64 - 1))
def test_a_trailer_comes_off_as_it_went_on(payload: bytes, event: int, time: int) -> None:
    data = append_trailer(payload, event, time)
    assert len(data) == len(payload) + TRAILER_LENGTH
    assert split_trailer(data) == (payload, Trailer(event, time))


def test_the_trailer_is_laid_out_as_published() -> None:
    tlvs = bytes.fromhex("0108" + "0000000000000007" + "0204" + "00000003")
    assert append_trailer(b"", 3, 7) == bytes(b ^ 0xFF for b in tlvs) + bytes([21 ^ 0xFF]) + b"LKTS"


def test_unknown_tags_in_a_trailer_are_skipped() -> None:
    tlvs = bytes.fromhex("7f02aabb" + "0204" + "00000003" + "0900")
    data = b"frame" + bytes(b ^ 0xFF for b in tlvs) + bytes([(len(tlvs) + 5) ^ 0xFF]) + b"LKTS"
    assert split_trailer(data) == (b"frame", Trailer(3, None))


@pytest.mark.parametrize(
    "tlvs", ["02", "0204", "020400", "0108000000", "02040000000301"], ids=["tag", "no value", "short", "time", "rest"]
)
def test_a_trailer_with_a_broken_tlv_is_no_trailer(tlvs: str) -> None:
    raw = bytes.fromhex(tlvs)
    data = b"frame" + bytes(b ^ 0xFF for b in raw) + bytes([(len(raw) + 5) ^ 0xFF]) + b"LKTS"
    assert split_trailer(data) == (data, None)


@pytest.mark.parametrize("data", [b"", b"LKTS", b"\xffLKTS", bytes([4 ^ 0xFF]) + b"LKTS", b"x" * 40])
def test_data_without_a_trailer_is_left_alone(data: bytes) -> None:
    assert split_trailer(data) == (data, None)


def test_a_frame_id_of_0_means_unset() -> None:
    tlvs = bytes.fromhex("020400000000")
    data = bytes(b ^ 0xFF for b in tlvs) + bytes([(len(tlvs) + 5) ^ 0xFF]) + b"LKTS"
    assert split_trailer(data) == (b"", Trailer(None, None))


@given(mutated(st.builds(append_trailer, st.binary(max_size=30), events, st.integers(0, 2**64 - 1))))
def test_any_bytes_give_a_payload_and_maybe_a_valid_reference(data: bytes) -> None:
    payload, trailer = split_trailer(data)
    assert data.startswith(payload)
    if trailer is not None and trailer.event is not None:
        assert 1 <= trailer.event <= MAX_EVENT

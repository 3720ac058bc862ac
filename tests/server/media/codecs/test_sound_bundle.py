"""Bundles are taken apart here by a parser of our own, and by libopus."""

from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.codecs.sound_bundle import BUNDLE_PACKETS, SoundBundle
from lockstep.server.media.codecs.sound_encoder import EncodedSound, Segment, create_sound_encoder

STEP = {"opus": 960, "PCMU": 160}


def sound(data: bytes, place: int, *, talkspurt: bool = False, step: int = 960) -> EncodedSound:
    return EncodedSound(data, place * step, 1 + place, 100 + place / 50, 5 + place / 50, talkspurt)


def frames_of(packet: bytes) -> list[bytes]:
    """The frames of an Opus packet, each as a packet by itself (RFC 6716 3.2.2 and 3.2.5)."""
    head = packet[0]
    if head & 3 == 0:
        return [packet]
    assert head & 3 == 3
    assert packet[1] & 0xC0 == 0x80  # lengths of their own, no padding
    count, at, sizes = packet[1] & 0x3F, 2, []
    for _ in range(count - 1):
        size, at = packet[at], at + 1
        if size >= 252:
            size, at = size + 4 * packet[at], at + 1
        sizes.append(size)
    sizes.append(len(packet) - at - sum(sizes))
    found = []
    for size in sizes:
        found.append(bytes((head & 0xFC,)) + packet[at : at + size])
        at += size
    return found


@given(
    st.lists(
        st.tuples(
            st.sampled_from([0x78, 0x7C, 0x08]),  # three configurations
            st.sampled_from([0, 1, 80, 251, 252, 253, 255, 256, 1019, 1275]),
            st.booleans(),
            st.integers(0, 9),
        ),
        max_size=20,
    )
)
def test_a_bundle_holds_what_follows_each_other_and_nothing_is_lost_or_doubled(
    packets: list[tuple[int, int, bool, int]],
) -> None:
    bundle, place, given_in, came = SoundBundle("opus", STEP["opus"]), 0, [], []
    for number, (head, size, talkspurt, skipped) in enumerate(packets):
        place += 1 + (skipped == 9)
        given_in.append(sound(bytes((head,)) + bytes([number]) * size, place, talkspurt=talkspurt and number % 4 == 3))
        came += bundle.add(given_in[-1])
    held = 0 if bundle.empty else len(given_in) - sum(len(frames_of(each.data)) for each in came)
    whole = given_in[: len(given_in) - held]
    assert [frame for each in came for frame in frames_of(each.data)] == [each.data for each in whole]
    assert held < BUNDLE_PACKETS
    for each in came:
        first = next(known for known in whole if known.media_time == each.media_time)
        assert first._replace(data=each.data) == each  # the oldest sound's stamp and times
        members = whole[whole.index(first) :][: len(frames_of(each.data))]
        assert len(members) <= BUNDLE_PACKETS
        assert [known.media_time for known in members] == [each.media_time + i * 960 for i in range(len(members))]
        assert not any(known.talkspurt for known in members[1:])


@pytest.mark.parametrize("channels", [1, 2])
def test_a_decoder_makes_the_same_sound_of_bundles_as_of_their_packets(channels: int) -> None:
    encoder = create_sound_encoder("opus", 48_000, 10)
    rng, packets = np.random.default_rng(7), []
    for i in range(150):  # tone, noise and silence, so that the encoder changes its mind
        phase = np.arange(i * 960, (i + 1) * 960) * 440 * 2 * np.pi / 48_000
        wave = [np.sin(phase) * 8000, rng.normal(0, 4000, 960), np.zeros(960)][i // 20 % 3]
        samples = np.repeat(wave.astype(np.int16), channels)
        packets += encoder.encode(Segment(samples, 48_000, channels, i + 1, i / 50, 1000 + i / 50))
    bundle = SoundBundle("opus", 960)
    bundles = [each for packet in packets for each in bundle.add(packet)]
    assert len(bundles) < 0.5 * len(packets)
    whole, parts = decoded([each.data for each in bundles]), decoded([each.data for each in packets])
    assert len(whole) > 0
    assert np.array_equal(whole, parts[: len(whole)])


def decoded(packets: list[bytes]) -> npt.NDArray[np.float32]:
    context: Any = av.CodecContext.create("libopus", "r")
    context.sample_rate, context.layout = 48_000, "stereo"
    frames = [frame for packet in packets for frame in context.decode(av.Packet(packet))]
    return np.concatenate([frame.to_ndarray().reshape(-1) for frame in frames])


def test_g711_is_put_together_as_it_is() -> None:
    bundle = SoundBundle("PCMU", STEP["PCMU"])
    came = [each for i in range(4) for each in bundle.add(sound(bytes([i]) * 160, i, step=160))]
    assert [each.data for each in came] == [bytes([0]) * 160 + bytes([1]) * 160 + bytes([2]) * 160]
    assert not bundle.empty


def test_an_opus_packet_of_several_frames_stays_by_itself() -> None:
    bundle = SoundBundle("opus", STEP["opus"])
    several = [bytes((0x79,)) + bytes(10), bytes((0x78,)) + bytes(5), b""]
    came = [each for i, data in enumerate([*several, bytes((0x78, 1))]) for each in bundle.add(sound(data, i))]
    assert [each.data for each in came] == several

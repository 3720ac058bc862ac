import secrets
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.srtp import (
    PROFILES,
    SrtpKeys,
    SrtpPacketTooLong,
    SrtpProfile,
    SrtpReceiver,
    SrtpSender,
    available_profiles,
)


def keys(profile: SrtpProfile) -> tuple[SrtpKeys, SrtpKeys]:
    material = secrets.token_bytes(2 * (profile.key_length + profile.salt_length))
    return SrtpKeys.split(profile, material, True), SrtpKeys.split(profile, material, False)


def rtp(sequence: int = 1, ssrc: int = 7, payload: bytes = b"payload") -> bytes:
    return struct.pack("!BBHII", 0x80, 96, sequence, 0, ssrc) + payload


RTCP = struct.pack("!BBHI", 0x80, 201, 1, 7)


def pair(profile: SrtpProfile = PROFILES[-1]) -> tuple[SrtpSender, SrtpReceiver]:
    client, server = keys(profile)
    return SrtpSender(client), SrtpReceiver(server)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.name)
def test_what_one_end_encrypts_the_other_decrypts(profile: SrtpProfile) -> None:
    assert profile in available_profiles()
    client, server = keys(profile)
    for ours, theirs in ((client, server), (server, client)):
        sender, receiver = SrtpSender(ours), SrtpReceiver(theirs)
        protected = sender.protect(rtp())
        assert b"payload" not in protected
        assert receiver.unprotect(protected) == rtp()
        control = sender.protect_rtcp(RTCP)
        assert control != RTCP
        assert receiver.unprotect_rtcp(control) == RTCP
        assert not receiver.counts


def test_a_packet_of_somebody_else_is_counted_by_name() -> None:
    sender, _ = pair()
    _, receiver = pair()
    assert receiver.unprotect(sender.protect(rtp())) is None
    assert receiver.unprotect_rtcp(sender.protect_rtcp(RTCP)) is None
    assert receiver.counts == {"authentication": 2}


def test_a_packet_that_came_twice_or_far_too_late_is_counted_by_name() -> None:
    sender, receiver = pair()
    old = sender.protect(rtp(1))
    new = sender.protect(rtp(5000))
    assert receiver.unprotect(new) == rtp(5000)
    assert receiver.unprotect(new) is None
    assert receiver.unprotect(old) is None
    assert receiver.counts == {"replay": 2}


def test_a_packet_that_is_sent_again_unchanged_is_allowed() -> None:
    sender, receiver = pair()
    first, second = sender.protect(rtp()), sender.protect(rtp())
    assert first == second
    assert receiver.unprotect(second) == rtp()


def test_sequence_numbers_wrap() -> None:
    sender, receiver = pair()
    for number in range(65530, 65545):
        packet = rtp(number & 0xFFFF)
        assert receiver.unprotect(sender.protect(packet)) == packet


def test_a_peer_has_a_bounded_number_of_sources() -> None:
    sender, receiver = pair()
    for ssrc in range(64):
        assert receiver.unprotect(sender.protect(rtp(ssrc=ssrc))) is not None
    assert receiver.unprotect(sender.protect(rtp(ssrc=64))) is None
    assert receiver.counts == {"sources": 1}
    assert receiver.unprotect(sender.protect(rtp(2, ssrc=3))) is not None


def test_strangers_use_up_no_sources() -> None:
    sender, receiver = pair()
    stranger, _ = pair()
    for ssrc in range(100):
        receiver.unprotect(stranger.protect(rtp(ssrc=ssrc)))
    assert receiver.unprotect(sender.protect(rtp(ssrc=100))) is not None


def test_the_longest_packet_passes_and_a_longer_one_is_a_named_error() -> None:
    for profile in PROFILES:
        sender, receiver = pair(profile)
        longest = rtp(payload=bytes(1356 - 12))
        assert receiver.unprotect(sender.protect(longest)) == longest
        with pytest.raises(SrtpPacketTooLong, match="1357 bytes"):
            sender.protect(longest + b"x")
        control = RTCP * 169
        assert receiver.unprotect_rtcp(sender.protect_rtcp(control)) == control
        with pytest.raises(SrtpPacketTooLong):
            sender.protect_rtcp(RTCP * 170)


def test_keys_are_in_no_text() -> None:
    client, _ = keys(PROFILES[0])
    assert "local" not in repr(client)
    assert "remote" not in repr(client)


@pytest.fixture(scope="module")
def attacked() -> SrtpReceiver:
    return pair()[1]


@given(st.binary(max_size=2000))
def test_no_bytes_raise(attacked: SrtpReceiver, data: bytes) -> None:
    assert attacked.unprotect(data) is None
    assert attacked.unprotect_rtcp(data) is None

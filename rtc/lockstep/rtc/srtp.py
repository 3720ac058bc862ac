"""SRTP and SRTCP (RFC 3711, RFC 7714): encryption of media, by pylibsrtp. One object for each direction."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import pylibsrtp
from pylibsrtp import Policy, Session

__all__ = [
    "PROFILES",
    "SrtpKeys",
    "SrtpPacketTooLong",
    "SrtpProfile",
    "SrtpReceiver",
    "SrtpSender",
    "available_profiles",
]

MAX_PACKET = 1356  # bytes before encryption: pylibsrtp has 1500 for a packet and the longest trailer there is
REPLAY_WINDOW = 1024  # packets; at 10 Mbit/s that is one second, more than a network reorders by
MAX_SOURCES = 64  # SSRCs of one peer: libsrtp keeps a context for each and forgets none


@dataclass(frozen=True, slots=True)
class SrtpProfile:
    """One protection profile."""

    name: str  # as in RFC 5764 4.1.2 and RFC 7714 14.2; OpenSSL knows it by this name
    number: int  # libsrtp's
    key_length: int  # bytes
    salt_length: int  # bytes


PROFILES = (  # the strongest first
    SrtpProfile("SRTP_AEAD_AES_256_GCM", Policy.SRTP_PROFILE_AEAD_AES_256_GCM, 32, 12),
    SrtpProfile("SRTP_AEAD_AES_128_GCM", Policy.SRTP_PROFILE_AEAD_AES_128_GCM, 16, 12),
    SrtpProfile("SRTP_AES128_CM_SHA1_80", Policy.SRTP_PROFILE_AES128_CM_SHA1_80, 16, 14),
)


@cache
def available_profiles() -> tuple[SrtpProfile, ...]:
    """Return those of PROFILES that libsrtp was built with: AES-GCM needs OpenSSL in it."""
    return tuple(profile for profile in PROFILES if _is_available(profile))


def _is_available(profile: SrtpProfile) -> bool:
    try:
        Policy(srtp_profile=profile.number)
    except pylibsrtp.Error:
        return False
    return True


@dataclass(frozen=True, slots=True)
class SrtpKeys:
    """The keys from a DTLS handshake: master key and salt of each direction."""

    profile: SrtpProfile
    local: bytes = field(repr=False)  # for outgoing packets
    remote: bytes = field(repr=False)  # for the peer's packets

    @classmethod
    def split(cls, profile: SrtpProfile, material: bytes, is_client: bool) -> "SrtpKeys":
        """Split the key material that TLS exported (RFC 5764 4.2): keys of client and server, then their salts."""
        key, salt = profile.key_length, profile.salt_length
        client = material[:key] + material[2 * key : 2 * key + salt]
        server = material[key : 2 * key] + material[2 * key + salt : 2 * (key + salt)]
        return cls(profile, client, server) if is_client else cls(profile, server, client)


class SrtpPacketTooLong(ValueError):
    """A packet to be sent has more than MAX_PACKET bytes."""

    def __init__(self, length: int) -> None:
        self.length = length

    def __str__(self) -> str:
        return f"a packet of {self.length} bytes; at most {MAX_PACKET} can be encrypted"


class SrtpSender:
    """Encrypts outgoing packets."""

    def __init__(self, keys: SrtpKeys) -> None:
        self._session = _session(keys.profile, keys.local, Policy.SSRC_ANY_OUTBOUND)

    def protect(self, packet: bytes) -> bytes:
        """Return the RTP packet, encrypted. Raises SrtpPacketTooLong."""
        if len(packet) > MAX_PACKET:
            raise SrtpPacketTooLong(len(packet))
        return self._session.protect(packet)

    def protect_rtcp(self, packet: bytes) -> bytes:
        """Return the compound RTCP packet, encrypted. Raises SrtpPacketTooLong."""
        if len(packet) > MAX_PACKET - 4:  # of the index (RFC 3711 3.4)
            raise SrtpPacketTooLong(len(packet))
        return self._session.protect_rtcp(packet)


class SrtpReceiver:
    """Decrypts the peer's packets. Other packets are dropped and counted.

    `counts`: "authentication" (not from this peer), "replay" (seen before or too old), "sources" (more SSRCs than
    MAX_SOURCES), "malformed".
    """

    def __init__(self, keys: SrtpKeys) -> None:
        self._session = _session(keys.profile, keys.remote, Policy.SSRC_ANY_INBOUND)
        self._sources: set[int] = set()
        self.counts: Counter[str] = Counter()

    def unprotect(self, packet: bytes) -> bytes | None:
        """Return the decrypted RTP packet; None when it was dropped."""
        return self._take(packet, 8, self._session.unprotect)

    def unprotect_rtcp(self, packet: bytes) -> bytes | None:
        """Return the decrypted compound RTCP packet; None when it was dropped."""
        return self._take(packet, 4, self._session.unprotect_rtcp)

    def _take(self, packet: bytes, ssrc_at: int, unprotect: Callable[[bytes], bytes]) -> bytes | None:
        source = int.from_bytes(packet[ssrc_at : ssrc_at + 4], "big")
        if source not in self._sources and len(self._sources) >= MAX_SOURCES:
            self.counts["sources"] += 1
            return None
        try:
            plain = unprotect(packet)
        except pylibsrtp.Error as error:
            self.counts[_name(error)] += 1
            return None
        except ValueError:  # longer than pylibsrtp's buffer
            self.counts["malformed"] += 1
            return None
        self._sources.add(source)  # only now: any sender can write an SSRC
        return plain


def _session(profile: SrtpProfile, key: bytes, direction: int) -> Session:
    policy = Policy(key=key, ssrc_type=direction, srtp_profile=profile.number)
    policy.allow_repeat_tx = True  # a retransmission without RTX is the same packet again (RFC 4585 6.2.1)
    policy.window_size = REPLAY_WINDOW
    return Session(policy)


def _name(error: pylibsrtp.Error) -> str:
    text = str(error)  # of `pylibsrtp.ERRORS`: the exceptions carry nothing else
    if text.startswith("authentication"):
        return "authentication"
    return "replay" if text.startswith(("replay", "packet index")) else "malformed"

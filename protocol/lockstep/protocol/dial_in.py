"""The token of a robot that dials its console, and the proofs of pairing (docs/robot-link.md, "Dialling out").

No I/O, no clock. A *key* is a link secret that one robot and one console share. A *code* lets them agree on a key: a
person reads it on the console's page and types it at the robot.
"""

import hashlib
import hmac
import re
import secrets
from typing import Annotated, NamedTuple

import msgspec

from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret

__all__ = [
    "DIAL",
    "MAX_PAIRING_MESSAGE",
    "OWN_LINK_ENDS",
    "TRUSTED",
    "WAITS",
    "WAIT_HEADER",
    "PairingAnswer",
    "PairingChallenge",
    "PairingCode",
    "PairingHello",
    "PairingProof",
    "PairingSecret",
    "RobotToken",
    "certificate_pin",
]

DIAL = "/dial/"  # the console's paths for robots begin so, below its own or a robot's address
ALPHABET = "23456789ABCDEFGHJKMNPQRSTVWXYZ"  # without what people take for something else: 0 O, 1 I L, U V
PLACE_SIGNS, SECRET_SIGNS = 2, 10  # 30^10 is 49 bits
NONCE_BYTES = 32
SALT_BYTES = 16
MAX_PAIRING_MESSAGE = 2048  # bytes
EXAMPLE = "K7-3F9QW-2MXBD"
SCHEME = "LockstepRobot"  # of the request's `Authorization` (RFC 9110 11.4)
TRUSTED = "trusted"  # instead of a pin: the robot has checked the console's certificate against its authorities
WAIT_HEADER, WAITS = "Lockstep-Link", "waits"  # of the answer: the console has another connection for this link
OWN_LINK_ENDS = 6.0  # s; the console ends a robot's own link from before a break sooner, for its silence
SCRYPT_COST = {"n": 1 << 15, "r": 8, "p": 1, "maxmem": 64 << 20}  # 32 MiB and some 60 ms

_CODE = re.compile(rf"[{ALPHABET}]{{{PLACE_SIGNS + SECRET_SIGNS}}}")


class PairingCode(NamedTuple):
    """A code. `place` names it and may be known; `secret` never leaves the two sides."""

    place: str  # "K7"
    secret: str  # "3F9QW2MXBD"

    @classmethod
    def draw(cls) -> "PairingCode":
        signs = "".join(secrets.choice(ALPHABET) for _ in range(PLACE_SIGNS + SECRET_SIGNS))
        return cls(signs[:PLACE_SIGNS], signs[PLACE_SIGNS:])

    @classmethod
    def parse(cls, text: str) -> "PairingCode":
        """Read a code as a person types it: in any case, with spaces and dashes anywhere.

        Raises:
            SecretError: it is not a code.
        """
        signs = re.sub(r"[\s-]", "", text[:200]).upper()
        if _CODE.fullmatch(signs) is None:
            raise SecretError(f"a pairing code has {PLACE_SIGNS + SECRET_SIGNS} letters and digits, as in {EXAMPLE}")
        return cls(signs[:PLACE_SIGNS], signs[PLACE_SIGNS:])

    def __str__(self) -> str:
        half = SECRET_SIGNS // 2
        return f"{self.place}-{self.secret[:half]}-{self.secret[half:]}"


class PairingSecret:
    """A code's secret, stretched by scrypt (RFC 7914) once. Proofs and the key are HMACs with it.

    The robot proves first, so a stranger that plays the robot learns nothing against which codes could be tried. A
    stranger that plays the console gets the robot's proof, but has to find the code before the robot gives up: only
    then is its own proof right. Every proof and the key contain `pin`: a stranger between the two, who has another
    certificate, gets proofs that are right for neither side.
    """

    def __init__(self, code: PairingCode, salt: bytes) -> None:
        """Takes some 60 ms."""
        self._key = hashlib.scrypt(code.secret.encode(), salt=salt + code.place.encode(), dklen=32, **SCRYPT_COST)

    def robot_proof(self, robot_nonce: bytes, console_nonce: bytes, pin: str) -> bytes:
        return self._digest(b"lockstep-pair-1 robot", robot_nonce, console_nonce, pin)

    def console_proof(self, robot_nonce: bytes, console_nonce: bytes, pin: str) -> bytes:
        return self._digest(b"lockstep-pair-1 console", robot_nonce, console_nonce, pin)

    def link_key(self, robot_nonce: bytes, console_nonce: bytes, pin: str) -> LinkSecret:
        """The key that both sides keep."""
        return LinkSecret(self._digest(b"lockstep-pair-1 key", robot_nonce, console_nonce, pin).hex())

    def _digest(self, label: bytes, robot_nonce: bytes, console_nonce: bytes, pin: str) -> bytes:
        """Return the HMAC. The nonces have a fixed length, so different inputs are never the same bytes."""
        return hmac.digest(self._key, label + b"\0" + robot_nonce + console_nonce + pin.encode(), hashlib.sha256)

    def __repr__(self) -> str:
        return "PairingSecret(…)"


class RobotToken(NamedTuple):
    """The token that a robot shows in its request, so that a console opens nothing for strangers.

    It does not reveal the key, and only lets a connection in. After that both sides prove that they know the key, as on
    every robot link.
    """

    text: str

    @classmethod
    def of(cls, key: LinkSecret) -> "RobotToken":
        secret = key.reveal().encode()
        return cls(hmac.digest(secret, b"lockstep-dial-1 token", hashlib.sha256).hex())

    @property
    def header(self) -> str:
        """The value of the request's `Authorization`."""
        return f"{SCHEME} {self.text}"

    def fits(self, header: str) -> bool:
        """Return whether the header has this token. Compares in constant time."""
        return hmac.compare_digest(header[:200].encode(errors="replace"), self.header.encode())

    def __repr__(self) -> str:
        return "RobotToken(…)"


Nonce = Annotated[bytes, msgspec.Meta(min_length=NONCE_BYTES, max_length=NONCE_BYTES)]
Proof = Annotated[bytes, msgspec.Meta(min_length=32, max_length=32)]


class PairingHello(msgspec.Struct, frozen=True, kw_only=True, tag="pair"):
    """Robot to console, first."""

    place: Annotated[str, msgspec.Meta(min_length=PLACE_SIGNS, max_length=PLACE_SIGNS)]
    nonce: Nonce
    pin: Annotated[str, msgspec.Meta(max_length=80)]  # of the certificate that the robot sees; or `TRUSTED`
    robot: Annotated[str, msgspec.Meta(max_length=64)] = ""  # for people


class PairingChallenge(msgspec.Struct, frozen=True, kw_only=True, tag="challenge"):
    """Console to robot."""

    nonce: Nonce
    salt: Annotated[bytes, msgspec.Meta(min_length=SALT_BYTES, max_length=SALT_BYTES)]


class PairingProof(msgspec.Struct, frozen=True, kw_only=True, tag="proof"):
    """Robot to console."""

    proof: Proof


class PairingAnswer(msgspec.Struct, frozen=True, kw_only=True, tag="paired"):
    """Console to robot, last: the console's proof, or the reason of a refusal."""

    proof: Annotated[bytes, msgspec.Meta(max_length=32)] = b""  # empty when refused
    error: Annotated[str, msgspec.Meta(max_length=60)] = ""  # stable name; "" when paired
    detail: Annotated[str, msgspec.Meta(max_length=500)] = ""


def certificate_pin(certificate: bytes) -> str:
    """Return the pin of a certificate's public key: "sha256:" and 64 hexadecimal digits of its SubjectPublicKeyInfo.

    The key stays when a certificate is renewed. `certificate` is DER (RFC 5280 4.1).

    Raises:
        SecretError: it is not a certificate.
    """
    try:
        at, _ = _content(certificate, 0, 0x30)  # Certificate
        at, _ = _content(certificate, at, 0x30)  # TBSCertificate
        if certificate[at] == 0xA0:  # version
            at = _content(certificate, at, 0xA0)[1]
        for tag in (0x02, 0x30, 0x30, 0x30, 0x30):  # serial, algorithm, issuer, validity, subject
            at = _content(certificate, at, tag)[1]
        end = _content(certificate, at, 0x30)[1]
    except (IndexError, ValueError) as error:
        raise SecretError("the console's certificate cannot be read") from error
    return f"sha256:{hashlib.sha256(certificate[at:end]).hexdigest()}"


def _content(data: bytes, at: int, tag: int) -> tuple[int, int]:
    """Return where the content of the DER element at `at` begins and ends."""
    if data[at] != tag:
        raise ValueError("another element")
    length, begin = data[at + 1], at + 2
    if length >= 0x80:
        size = length & 0x7F
        if not 1 <= size <= 4:
            raise ValueError("a length that no certificate has")
        length, begin = int.from_bytes(data[begin : begin + size]), begin + size
    if begin + length > len(data):
        raise ValueError("cut off")
    return begin, begin + length

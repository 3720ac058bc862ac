"""Fingerprints of certificates (RFC 8122): the hashes of the expected certificate in a session description."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from cryptography import x509
from cryptography.hazmat.primitives import hashes

__all__ = ["SUPPORTED_HASHES", "Fingerprint", "fingerprint_of", "is_expected"]

_HASHES: dict[str, type[hashes.HashAlgorithm]] = {
    "sha-512": hashes.SHA512,
    "sha-384": hashes.SHA384,
    "sha-256": hashes.SHA256,  # RFC 8122 5: every peer has this one
}
SUPPORTED_HASHES = tuple(_HASHES)  # the strongest first
HASH_BYTES = {"sha-1": 20, "sha-224": 28, "sha-256": 32, "sha-384": 48, "sha-512": 64}  # RFC 8122 5
HEX_PAIRS = re.compile(r"[0-9A-Fa-f]{2}(:[0-9A-Fa-f]{2})*")


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """One `a=fingerprint` line."""

    algorithm: str  # "sha-256", in lower case
    value: str  # "AB:CD:…", in upper case

    @classmethod
    def parse(cls, text: str) -> "Fingerprint":
        """Return the fingerprint in "sha-256 AB:CD:…". Raises ValueError."""
        algorithm, _, value = text.strip().partition(" ")
        algorithm, value = algorithm.lower(), value.strip()
        length = HASH_BYTES.get(algorithm)
        if not HEX_PAIRS.fullmatch(value) or len(value) != 3 * (length or (len(value) + 1) // 3) - 1:
            raise ValueError("not a fingerprint (RFC 8122 5)")
        return cls(algorithm, value.upper())

    def __str__(self) -> str:
        return f"{self.algorithm} {self.value}"


def fingerprint_of(certificate: x509.Certificate, algorithm: str = "sha-256") -> Fingerprint:
    """Return the fingerprint of `certificate`; `algorithm` is one of SUPPORTED_HASHES."""
    digest = certificate.fingerprint(_HASHES[algorithm]())
    return Fingerprint(algorithm, digest.hex(":").upper())


def is_expected(certificate: x509.Certificate, expected: Sequence[Fingerprint]) -> bool:
    """True if `certificate` has one of the `expected` fingerprints of the strongest supported hash among them."""
    for algorithm in SUPPORTED_HASHES:
        of_this = [each for each in expected if each.algorithm == algorithm]
        if of_this:  # RFC 8122 5: weaker hashes are ignored
            return fingerprint_of(certificate, algorithm) in of_this
    return False

"""Self-signed certificates for DTLS (RFC 8827 6.5): a session description carries their fingerprint."""

import datetime
from dataclasses import dataclass, field

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from lockstep.rtc.fingerprint import Fingerprint, fingerprint_of

__all__ = ["Certificate"]

VALID_DAYS = 30  # RFC 8827 4.3.2.3 is about browsers, whose certificates are valid for as long
SKEW_DAYS = 1  # clocks of peers may be behind this one


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate and its private key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey = field(repr=False)

    @classmethod
    def generate(cls) -> "Certificate":
        """Return a new ECDSA certificate on P-256, which every WebRTC peer takes (RFC 8827 6.5)."""
        return cls.for_key(ec.generate_private_key(ec.SECP256R1()))

    @classmethod
    def for_key(cls, key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey) -> "Certificate":
        """Return a new certificate for `key`. It has no name, so that no observer can tell that two sessions belong to
        one person."""
        name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "WebRTC")])
        now = datetime.datetime.now(tz=datetime.UTC)
        builder = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - datetime.timedelta(days=SKEW_DAYS))
            .not_valid_after(now + datetime.timedelta(days=VALID_DAYS))
        )
        return cls(builder.sign(key, hashes.SHA256()), key)

    @property
    def fingerprint(self) -> Fingerprint:
        """The SHA-256 fingerprint, for the session description."""
        return fingerprint_of(self.certificate)

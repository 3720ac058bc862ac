"""TLS: a self-signed certificate for the console's names and addresses, kept in the state directory."""

import datetime
import ipaddress
import os
import socket
import ssl
from pathlib import Path
from typing import NamedTuple, Protocol

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from lockstep.protocol.dial_in import certificate_pin
from lockstep.protocol.errors import SecretError

__all__ = ["Certificate", "ends_at", "fingerprint", "own_names", "own_pin", "self_signed", "shown_by", "trusting"]

DAYS = 397  # more is refused by some browsers
RENEW_DAYS = 30  # before its end, when it is renewed
NO_CHECK_TIME = ssl.VerifyFlags(0x200000)  # X509_V_FLAG_NO_CHECK_TIME of OpenSSL, which Python does not name
CERTIFICATE, KEY = "tls-cert.pem", "tls-key.pem"


class TlsSettings(Protocol):
    @property
    def tls(self) -> object: ...
    @property
    def tls_cert(self) -> Path | None: ...


class Certificate(NamedTuple):
    """The files of a certificate, in PEM."""

    chain: Path
    key: Path


def self_signed(directory: Path, names: set[str], now: datetime.datetime) -> Certificate:
    """Return the certificate in `directory`; make a new one if it is missing, ends soon, or lacks one of `names`.

    It is the same at every start, so a browser that was told to trust it does not ask again. A new one has the key of
    the old one: robots that were paired with this console know it by its key.
    """
    kept = Certificate(directory / CERTIFICATE, directory / KEY)
    if not _is_good(kept, names, now):
        directory.mkdir(parents=True, exist_ok=True, mode=0o700)
        key = _kept_key(kept.key)
        if key is None:
            key = ec.generate_private_key(ec.SECP256R1())
            _write(kept.key, _pem(key))
        _write(kept.chain, _certificate(key, names, now).public_bytes(serialization.Encoding.PEM))
    return kept


def own_pin(settings: TlsSettings, directory: Path) -> str | None:
    """Return the pin of the console's certificate, as robots see it; None: it has none, or cannot read it.

    `directory`: where a self-signed one is.
    """
    chain = settings.tls_cert or (directory / CERTIFICATE if settings.tls else None)
    if chain is None:
        return None
    try:
        return certificate_pin(_load(Certificate(chain, chain)).public_bytes(serialization.Encoding.DER))
    except (OSError, ValueError, SecretError):
        return None


def own_names(listening_on: str) -> set[str]:
    """Return the names and addresses by which clients may ask for this machine on `listening_on`."""
    names = {"localhost", "127.0.0.1", "::1", socket.gethostname().lower()}
    if listening_on not in ("", "0.0.0.0", "::"):
        names.add(listening_on)
    return names


def fingerprint(certificate: Certificate) -> str:
    """SHA-256 of the certificate, as browsers show it."""
    digest = _load(certificate).fingerprint(hashes.SHA256()).hex().upper()
    return ":".join(digest[at : at + 2] for at in range(0, len(digest), 2))


def shown_by(certificate: Certificate) -> str:
    """Return the certificate itself, in PEM, without those that vouch for it."""
    return _load(certificate).public_bytes(serialization.Encoding.PEM).decode()


def trusting(shown: str) -> ssl.SSLContext:
    """Return the context of a client that takes this certificate (PEM), and no other, whatever the console's name is.

    Raises:
        ValueError: it is no certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    # It need not be an authority's, and counts after its end too: a console may run for longer than that.
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN | NO_CHECK_TIME
    try:
        context.load_verify_locations(cadata=shown)
    except ssl.SSLError as error:
        raise ValueError(f"no certificate: {error}") from error
    return context


def ends_at(certificate: Certificate) -> float:
    """Return the time of the certificate's end, s since 1970."""
    return _load(certificate).not_valid_after_utc.timestamp()


def _kept_key(path: Path) -> ec.EllipticCurvePrivateKey | None:
    try:
        key = serialization.load_pem_private_key(path.read_bytes(), None)
    except (OSError, ValueError, TypeError):
        return None
    return key if isinstance(key, ec.EllipticCurvePrivateKey) and isinstance(key.curve, ec.SECP256R1) else None


def _load(certificate: Certificate) -> x509.Certificate:
    return x509.load_pem_x509_certificate(certificate.chain.read_bytes())


def _is_good(kept: Certificate, names: set[str], now: datetime.datetime) -> bool:
    try:
        found = _load(kept)
        key = serialization.load_pem_private_key(kept.key.read_bytes(), None)
        known = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, TypeError, x509.ExtensionNotFound):
        return False
    in_it = {str(each) for kind in (x509.DNSName, x509.IPAddress) for each in known.get_values_for_type(kind)}
    lasts = found.not_valid_before_utc <= now < found.not_valid_after_utc - datetime.timedelta(days=RENEW_DAYS)
    return lasts and names <= in_it and key.public_key() == found.public_key()


def _certificate(key: ec.EllipticCurvePrivateKey, names: set[str], now: datetime.datetime) -> x509.Certificate:
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Lockstep console")])
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(minutes=5))
        .not_valid_after(now + datetime.timedelta(days=DAYS))
        .add_extension(x509.SubjectAlternativeName([_general_name(name) for name in sorted(names)]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )


def _general_name(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _write(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all, readable by its owner alone."""
    beside = path.with_suffix(".new")
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
    beside.replace(path)

"""Pairing codes, what both sides derive from them, the robot's token, and the pin of a certificate."""

import datetime
import hashlib

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.dial_in import ALPHABET, PairingCode, PairingSecret, RobotToken, certificate_pin
from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret

SALT = bytes(16)
NONCES = (b"r" * 32, b"c" * 32)


def certificate(
    key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey | ed25519.Ed25519PrivateKey, serial: int
) -> x509.Certificate:
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "console" * 9)])
    now = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    made = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    made = made.serial_number(serial).not_valid_before(now).not_valid_after(now + datetime.timedelta(days=1))
    return made.sign(key, None if isinstance(key, ed25519.Ed25519PrivateKey) else hashes.SHA256())


@pytest.mark.parametrize(
    "key",
    [
        ec.generate_private_key(ec.SECP256R1()),
        rsa.generate_private_key(65537, 2048),
        ed25519.Ed25519PrivateKey.generate(),
    ],
)
def test_a_pin_is_of_the_public_key_and_outlives_a_renewal(
    key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey | ed25519.Ed25519PrivateKey,
) -> None:
    spki = key.public_key().public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)
    for serial in (1, 2**150):
        der = certificate(key, serial).public_bytes(serialization.Encoding.DER)
        assert certificate_pin(der) == f"sha256:{hashlib.sha256(spki).hexdigest()}"


DER = certificate(ec.generate_private_key(ec.SECP256R1()), 2**100).public_bytes(serialization.Encoding.DER)


@given(st.one_of(st.binary(max_size=80), st.integers(0, 300).map(lambda at: DER[:at])))
def test_bytes_that_are_no_certificate_raise_one_named_error(data: bytes) -> None:
    with pytest.raises(SecretError):
        certificate_pin(data)


def test_a_code_is_read_as_people_type_it() -> None:
    code = PairingCode.draw()
    for typed in (str(code), str(code).lower(), f"  {code.place} {code.secret} ", str(code).replace("-", "")):
        assert PairingCode.parse(typed) == code


@given(st.text(max_size=300))
def test_whatever_is_typed_is_a_code_or_a_named_error(text: str) -> None:
    try:
        code = PairingCode.parse(text)
    except SecretError:
        return
    assert set(code.place + code.secret) <= set(ALPHABET)


def test_codes_have_no_signs_that_people_take_for_others() -> None:
    assert not set("01OILU") & set(ALPHABET)


def test_both_sides_derive_the_same_from_a_code_and_something_else_from_anything_else() -> None:
    code, other = PairingCode("K7", "3F9QW2MXBD"), PairingCode("K7", "3F9QW2MXBE")
    here, there = PairingSecret(code, SALT), PairingSecret(code, SALT)
    assert here.robot_proof(*NONCES, "pin") == there.robot_proof(*NONCES, "pin")
    assert here.link_key(*NONCES, "pin").reveal() == there.link_key(*NONCES, "pin").reveal()
    proofs = {
        here.robot_proof(*NONCES, "pin"),
        here.console_proof(*NONCES, "pin"),
        here.robot_proof(*NONCES, "another pin"),
        here.robot_proof(NONCES[1], NONCES[0], "pin"),
        PairingSecret(other, SALT).robot_proof(*NONCES, "pin"),
        PairingSecret(code, b"s" * 16).robot_proof(*NONCES, "pin"),
    }
    assert len(proofs) == 6


def test_a_token_fits_its_own_key_alone_and_does_not_show_it() -> None:
    key, other = LinkSecret.draw(), LinkSecret.draw()
    assert RobotToken.of(key).fits(RobotToken.of(key).header)
    assert not RobotToken.of(key).fits(RobotToken.of(other).header)
    assert not RobotToken.of(key).fits("Bearer \udc80" + "x" * 10_000)
    assert key.reveal() not in RobotToken.of(key).header
    assert RobotToken.of(key).text not in repr(RobotToken.of(key))

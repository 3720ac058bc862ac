"""The key that signs heads of the audit and of recordings: Ed25519 (RFC 8032), one for each state directory."""

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
)

from lockstep.server.util.state_dir import StateDamaged, StateDir

__all__ = ["KEY_FILE", "Signer", "evidence_signer", "is_public_key", "is_signed"]

KEY_FILE = "evidence.key"
KEY_DIGITS, SIGNATURE_DIGITS = 64, 128


class Signer:
    """Signs with one private key. Thread-safe.

    Attributes:
        public_key: 64 hexadecimal digits
    """

    def __init__(self, private: Ed25519PrivateKey) -> None:
        self._private = private
        self.public_key = private.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw).hex()

    def sign(self, data: bytes) -> str:
        """Return the signature, 128 hexadecimal digits."""
        return self._private.sign(data).hex()


def evidence_signer(directory: StateDir) -> Signer:
    """Return the signer of the state directory; its key is made at the first call.

    Raises:
        StateDirUnusable: the key cannot be read or made.
        StateDamaged: the file does not hold a key.
    """
    pem = directory.secret(KEY_FILE, _fresh_key)
    try:
        private = load_pem_private_key(pem, None)
    except (ValueError, TypeError) as error:
        raise StateDamaged(directory.path / KEY_FILE, "not a private key") from error
    if not isinstance(private, Ed25519PrivateKey):
        raise StateDamaged(directory.path / KEY_FILE, "not an Ed25519 key")
    return Signer(private)


def _fresh_key() -> bytes:
    return Ed25519PrivateKey.generate().private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def is_public_key(text: str) -> bool:
    return _bytes(text, KEY_DIGITS) is not None


def is_signed(public_key: str, data: bytes, signature: str) -> bool:
    """True if the owner of `public_key` signed `data`. A malformed key or signature gives False."""
    key, signed = _bytes(public_key, KEY_DIGITS), _bytes(signature, SIGNATURE_DIGITS)
    if key is None or signed is None:
        return False
    try:
        Ed25519PublicKey.from_public_bytes(key).verify(signed, data)
    except (InvalidSignature, ValueError):
        return False
    return True


def _bytes(text: str, digits: int) -> bytes | None:
    if len(text) != digits:
        return None
    try:
        return bytes.fromhex(text)
    except ValueError:
        return None

"""The shared secret of a robot link: a side that knows it can prove so without sending it (docs/robot-link.md, "The
secret").

Each side proves it for the two nonces of this one handshake, so that a proof is worth nothing in another one.
"""

import hashlib
import hmac
import secrets
from pathlib import Path

from lockstep.protocol.errors import SecretError

__all__ = ["MIN_SECRET_BYTES", "NONCE_BYTES", "LinkSecret", "draw_nonce"]

MIN_SECRET_BYTES = 32  # as many as the hash has; a shorter one could be guessed from a proof, offline
NONCE_BYTES = 32


def draw_nonce() -> bytes:
    return secrets.token_bytes(NONCE_BYTES)


class LinkSecret:
    """Keeps the secret out of representations and logs.

    Raises:
        SecretError: it is too short.
    """

    def __init__(self, text: str) -> None:
        self._key = text.encode()
        if len(self._key) < MIN_SECRET_BYTES:
            raise SecretError(f"a link secret needs at least {MIN_SECRET_BYTES} bytes, this one has {len(self._key)}")

    @classmethod
    def read(cls, path: Path) -> "LinkSecret":
        """The file's text, without white space around it.

        Raises:
            SecretError: it cannot be read, or is too short.
        """
        try:
            return cls(path.read_text().strip())
        except (OSError, UnicodeError) as error:
            raise SecretError(f"cannot read the link secret: {error}") from error

    @classmethod
    def draw(cls) -> "LinkSecret":
        """A new random one."""
        return cls(secrets.token_urlsafe(MIN_SECRET_BYTES))

    def reveal(self) -> str:
        """The secret itself, to hand to a child process."""
        return self._key.decode()

    def client_proof(self, client_nonce: bytes, bridge_nonce: bytes, role: str) -> bytes:
        return self._proof(b"lockstep-link-1 client", client_nonce, bridge_nonce, role)

    def bridge_proof(self, client_nonce: bytes, bridge_nonce: bytes, epoch: str) -> bytes:
        return self._proof(b"lockstep-link-1 bridge", client_nonce, bridge_nonce, epoch)

    def _proof(self, label: bytes, client_nonce: bytes, bridge_nonce: bytes, said: str) -> bytes:
        """The nonces have a fixed length, so no two different inputs are the same bytes."""
        return hmac.digest(self._key, label + b"\0" + client_nonce + bridge_nonce + said.encode(), hashlib.sha256)

    @staticmethod
    def same(left: bytes, right: bytes) -> bool:
        """In constant time."""
        return hmac.compare_digest(left, right)

    def __repr__(self) -> str:
        return "LinkSecret(…)"

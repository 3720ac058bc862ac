"""Seals the consoles' values in the store with a key derived from the key that signs links.

A tile's address becomes a link that people follow with their token, and a STOP or a revocation is obeyed. So a
writer to the store without the signing key must not be believed. A seal does not hide anything.
"""

import hashlib
import hmac

from lockstep.server.federation.errors import InputNotSealed, InputTooLarge

__all__ = ["Seal"]

SIZE = 32  # characters: 128 bits in hexadecimal


class Seal:
    """A sealed text is its seal, then the text. `kind` keeps one text from passing for another."""

    def __init__(self, signing_key: str) -> None:
        self._key = hmac.digest(signing_key.encode(), b"lockstep board", hashlib.sha256)

    def put(self, kind: str, text: bytes) -> bytes:
        return self.of(kind, text) + text

    def take(self, kind: str, sealed: bytes, largest: int) -> bytes:
        """Check the seal and return the text.

        Raises:
            InputTooLarge: it has more than `largest` bytes.
            InputNotSealed: it is not sealed for this kind, by a console with the same signing key.
        """
        if len(sealed) > largest + SIZE:
            raise InputTooLarge(f"{kind}: more than {largest} bytes")
        text = sealed[SIZE:]
        if not hmac.compare_digest(sealed[:SIZE], self.of(kind, text)):
            raise InputNotSealed(f"{kind}: the writer has another signing key than this console")
        return text

    def of(self, kind: str, text: bytes) -> bytes:
        """Return the seal alone."""
        return hmac.digest(self._key, kind.encode() + b"\0" + text, hashlib.sha256).hex()[:SIZE].encode()

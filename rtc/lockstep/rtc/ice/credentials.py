"""User name fragment and password of one ICE session (RFC 8445 5.3), which signalling carries."""

import base64
import re
import secrets
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Credentials", "CredentialsError", "new_credentials"]

UFRAG = re.compile(r"[A-Za-z0-9+/]{4,256}")  # RFC 8839 5.4
PASSWORD = re.compile(r"[A-Za-z0-9+/]{22,256}")
UFRAG_BYTES = 6  # 48 random bits; RFC 8445 5.3 asks for 24: here they also keep strangers from being heard at all
PASSWORD_BYTES = 18  # 144 random bits; RFC 8445 5.3 asks for 128


class CredentialsError(ValueError):
    """A user name fragment or a password that RFC 8839 5.4 does not allow."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """The user name fragment and the password of one session.

    Raises:
        CredentialsError: of the wrong length, or of other characters than letters, digits, + and /.
    """

    ufrag: str
    password: str

    def __post_init__(self) -> None:
        if UFRAG.fullmatch(self.ufrag) is None:
            raise CredentialsError("ice-ufrag is not 4 to 256 letters, digits, + or /")
        if PASSWORD.fullmatch(self.password) is None:
            raise CredentialsError("ice-pwd is not 22 to 256 letters, digits, + or /")

    def __repr__(self) -> str:
        return f"Credentials(ufrag={self.ufrag!r})"  # the password stays out of logs


def new_credentials(random_bytes: Callable[[int], bytes] = secrets.token_bytes) -> Credentials:
    """Return credentials for one session; `random_bytes` returns as many as it is asked for, and they must be
    unpredictable."""
    ufrag, password = base64.b64encode(random_bytes(UFRAG_BYTES)), base64.b64encode(random_bytes(PASSWORD_BYTES))
    return Credentials(ufrag.decode(), password.decode())

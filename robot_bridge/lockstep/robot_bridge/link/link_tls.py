"""TLS on the robot link. Both sides speak TLS 1.3 only."""

import ssl
from dataclasses import dataclass
from pathlib import Path

from lockstep.protocol.errors import SecretError

__all__ = ["LinkTls"]


@dataclass(frozen=True, kw_only=True)
class LinkTls:
    """Files in PEM form for TLS.

    At a bridge: `certificate` and `key` are the bridge's; with `authority`, clients need a certificate that it signed.
    At a client: `authority` must have signed the bridge's certificate (None: an authority that this machine trusts
    must); `certificate` and `key` are shown to a bridge that asks.
    """

    certificate: Path | None = None
    key: Path | None = None  # None: the key is in the certificate's file
    authority: Path | None = None

    def bridge_context(self) -> ssl.SSLContext:
        """Return the bridge's context.

        Raises:
            SecretError: a file is missing or cannot be used.
        """
        if self.certificate is None:
            raise SecretError("TLS needs the bridge's certificate")
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._load(context)
        if self.authority is not None:
            context.verify_mode = ssl.CERT_REQUIRED
        return context

    def client_context(self) -> ssl.SSLContext:
        """Return the client's context.

        Raises:
            SecretError: a file is missing or cannot be used.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # checks the bridge's name and certificate
        if self.authority is None:
            context.load_default_certs()
        self._load(context)
        return context

    def _load(self, context: ssl.SSLContext) -> None:
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        try:
            if self.certificate is not None:
                context.load_cert_chain(self.certificate, self.key)
            if self.authority is not None:
                context.load_verify_locations(self.authority)
        except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
            raise SecretError(f"cannot use the TLS files of the robot link: {error}") from error

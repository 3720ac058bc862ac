"""The console's credentials at a robot bridge: the link's secret and TLS."""

import ssl
from pathlib import Path
from typing import NamedTuple, Protocol

from pydantic import SecretStr

from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.link.link_tls import LinkTls

__all__ = ["RobotLinkCredentials", "RobotLinkSettings", "link_access"]


class RobotLinkSettings(Protocol):
    @property
    def robot_uses_tls(self) -> bool: ...
    @property
    def link_secret(self) -> SecretStr | None: ...
    @property
    def link_secret_file(self) -> Path | None: ...
    @property
    def link_tls_cert(self) -> Path | None: ...
    @property
    def link_tls_key(self) -> Path | None: ...
    @property
    def link_tls_ca(self) -> Path | None: ...


class RobotLinkCredentials(NamedTuple):
    secret: LinkSecret | None = None
    tls: ssl.SSLContext | None = None


def link_access(settings: RobotLinkSettings) -> RobotLinkCredentials:
    """Read the credentials that the settings name. Raises SecretError if a file or the secret is invalid."""
    secret = None
    if settings.link_secret_file is not None:
        secret = LinkSecret.read(settings.link_secret_file)
    elif settings.link_secret is not None:
        secret = LinkSecret(settings.link_secret.get_secret_value())
    if not settings.robot_uses_tls:
        return RobotLinkCredentials(secret)
    files = LinkTls(certificate=settings.link_tls_cert, key=settings.link_tls_key, authority=settings.link_tls_ca)
    return RobotLinkCredentials(secret, files.client_context())

"""Runs Caddy with a configuration of `deploy/` before consoles."""

import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import started

__all__ = ["running_caddy"]

DEPLOY = Path(__file__).resolve().parents[4] / "deploy"


@asynccontextmanager
async def running_caddy(name: str, folder: Path, port: int, *, tls: bool = True, **settings: str) -> AsyncIterator[str]:
    """Start Caddy at `port` of localhost, and yield its address as people type it.

    `name`: of the configuration. `folder`: for its certificates. `settings`: of the configuration, LOCKSTEP_…

    Raises:
        ProcessFailed: it did not start.
    """
    address = f"https://localhost:{port}" if tls else f"http://localhost:{port}"
    environment = {
        "LOCKSTEP_SITE": "localhost" if tls else address,
        "LOCKSTEP_HTTPS_PORT": str(port if tls else free_port()),
        "LOCKSTEP_HTTP_PORT": str(free_port()),
        **dict.fromkeys(("HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME"), str(folder)),
        **settings,
    }
    command = ("caddy", "run", "--config", str(DEPLOY / name), "--adapter", "caddyfile")
    async with started(command, environment=environment) as caddy:
        await caddy.listening(port, context=_any_certificate() if tls else None)
        yield address


def _any_certificate() -> ssl.SSLContext:
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context

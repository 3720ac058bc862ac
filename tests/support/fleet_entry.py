"""The fleet's Caddyfile in a real Caddy: one entry for two consoles."""

import asyncio
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from lockstep.bench.harness.free_port import free_port

__all__ = ["running_entry"]

CADDYFILE = Path(__file__).resolve().parents[2] / "deploy" / "Caddyfile.fleet"
READY_SECONDS = 20.0


@asynccontextmanager
async def running_entry(directory: Path, one: str, two: str, port: int, *, tls: bool = True) -> AsyncIterator[None]:
    """At localhost:`port`; `one` and `two` are "host:port" of the consoles."""
    site = "localhost" if tls else f"http://localhost:{port}"
    settings = {"LOCKSTEP_SITE": site, "LOCKSTEP_ONE": one, "LOCKSTEP_TWO": two}
    ports = {"LOCKSTEP_HTTPS_PORT": str(port if tls else free_port()), "LOCKSTEP_HTTP_PORT": str(free_port())}
    folders = {"HOME": str(directory), "XDG_DATA_HOME": str(directory), "XDG_CONFIG_HOME": str(directory)}
    process = await asyncio.create_subprocess_exec(
        *("caddy", "run", "--config", str(CADDYFILE), "--adapter", "caddyfile"),
        env=os.environ | settings | ports | folders,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        async with asyncio.timeout(READY_SECONDS):
            while True:
                if process.returncode is not None:
                    raise RuntimeError("caddy ended")
                try:
                    _, writer = await asyncio.open_connection("127.0.0.1", port)
                except OSError:
                    await asyncio.sleep(0.05)
                else:
                    writer.close()
                    await writer.wait_closed()
                    break
        yield
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()

"""Keeps the WebSockets that a module opens, so that a test can see whether they were closed."""

from types import ModuleType
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect

__all__ = ["keep_websockets"]


def keep_websockets(patch: pytest.MonkeyPatch, module: ModuleType) -> list[ClientConnection]:
    """Return the list to which each WebSocket is added that `module` opens with websockets' `connect` from now on."""
    made: list[ClientConnection] = []

    async def kept(*args: Any, **options: Any) -> ClientConnection:
        made.append(await connect(*args, **options))
        return made[-1]

    patch.setattr(module, "connect", kept)
    return made

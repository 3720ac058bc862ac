"""Shares the state of several consoles behind one entry through a board (docs/fleet.md)."""

import importlib.util
import socket

from prometheus_client import CollectorRegistry

from lockstep.server.federation.board import Board, BoardHost
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardUnusable
from lockstep.server.federation.memory_board import MemoryBoard
from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.federation.revocations import KnownLinks
from lockstep.server.federation.settings import MAX_NAME, BoardSettings, check_address

__all__ = ["Board", "BoardHost", "check_board", "make_board"]

NOT_INSTALLED = "a board needs the package redis: .venv/bin/python -m pip install -e '.[redis]'"
NO_ADDRESS = "a board needs --public-url: the pages of other consoles link to it"


def make_board(
    settings: BoardSettings,
    signing_key: str,
    host: BoardHost,
    invitations: KnownLinks,
    public_url: str,
    registry: CollectorRegistry,
) -> Board:
    """Return the board that the settings name.

    Raises:
        BoardUnusable: this board cannot work here.
    """
    if not settings.has_board:
        return MemoryBoard()
    check_board(settings, public_url)
    from lockstep.server.federation.redis.redis_board import RedisBoard  # an optional extra

    name = settings.console_name or socket.gethostname()[:MAX_NAME]
    return RedisBoard(
        settings.board_url, Seal(signing_key), host, invitations, BoardMetrics(registry), public_url, name
    )


def check_board(settings: BoardSettings, public_url: str) -> None:
    """Check the board before anything else starts. Raises BoardUnusable with the reason that it cannot work."""
    if not settings.has_board:
        return
    if not public_url:
        raise BoardUnusable(NO_ADDRESS)
    if importlib.util.find_spec("redis") is None:
        raise BoardUnusable(NOT_INSTALLED)
    try:
        check_address(settings.board_url)
    except OSError as error:
        raise BoardUnusable(f"{settings.board_file}: {error.strerror}") from error
    except ValueError as error:
        raise BoardUnusable(str(error)) from error

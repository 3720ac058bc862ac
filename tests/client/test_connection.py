"""A connection whose own parts fail."""

from typing import NoReturn

import pytest

from lockstep.client import Console, ConsoleLost
from lockstep.client.heartbeat import Heartbeat
from tests.server.rig import eventually, running_rig


async def test_a_part_that_raises_ends_the_connection_by_name_and_all_is_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def fail(*arguments: object, **options: object) -> NoReturn:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(Heartbeat, "run", fail)
    async with running_rig() as rig:
        console = Console(f"{rig.url}/#token={rig.access.issue('observer', 'ann')}", name="ann")
        async with console:
            connection = console._live()
            with pytest.raises(ConsoleLost, match="this client failed: ZeroDivisionError: planted"):
                async for _ in console.feedbacks():
                    pass
        executor = connection.media._executor
        assert executor is None or executor._shutdown
        await eventually(lambda: not list(rig.dependencies.console.peers))

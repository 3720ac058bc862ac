"""A publication to a Janus; tests/server/sfu/test_through_janus.py has a real one."""

import asyncio
from typing import Any, cast

import pytest

from lockstep.server.sfu import janus_publishing
from lockstep.server.sfu.errors import RelaySilent
from lockstep.server.sfu.janus_publishing import _connected, _Line
from lockstep.server.sfu.publication import NEW_EPOCH, Publication
from tests.waiting import PATIENCE

NOTHING = cast(Any, None)


async def test_an_epoch_that_begins_during_the_negotiation_ends_the_publication_and_is_no_fault_of_the_relay() -> None:
    publication = Publication(7, [], lambda _: None)
    line = _Line(NOTHING, NOTHING, NOTHING, publication)
    line.streams_ended()
    async with asyncio.timeout(PATIENCE):
        await _connected(line, publication)
    assert publication.ended.is_set()
    assert publication.why == NEW_EPOCH


async def test_a_relay_without_a_path_for_media_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(janus_publishing, "CONNECT_SECONDS", 0.01)
    publication = Publication(7, [], lambda _: None)
    with pytest.raises(RelaySilent, match="no path for media"):
        await _connected(_Line(NOTHING, NOTHING, NOTHING, publication), publication)

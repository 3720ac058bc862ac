"""The session through real Janus, in network namespaces: headless observers see no picture outside the tolerance."""

import json
import sys
from pathlib import Path

import pytest

from lockstep.bench.relay.stage import RelayStage, relay_stage
from lockstep.emulator.errors import NamespacesUnavailable


async def _watch(stage: RelayStage, pictures: int = 20) -> dict[str, object]:
    command = (sys.executable, "-m", "lockstep.bench.relay.watcher", stage.links["observer"], str(pictures))
    watcher = await stage.start("operator", command)
    found: dict[str, object] = json.loads(await watcher.line(r'^\{"event"'))
    return found


async def test_every_picture_through_two_janus_has_its_event(tmp_path: Path) -> None:
    try:
        async with relay_stage(tmp_path) as stage:
            await stage.add_janus("robot", 0)
            await stage.add_janus("operator", 1)
            await stage.add_console([("robot", 0), ("operator", 1)], "--observers-direct", "0")
            first = await _watch(stage)
            second = await _watch(stage)
    except NamespacesUnavailable as error:
        pytest.skip(str(error))
    for found in (first, second):
        streams = found["streams"]
        assert isinstance(streams, dict)
        assert found["relay"] in ("0", "1")
        assert found["line"] == "WebSocketTransport"
        assert (found["note"], found["stopped"]) == ("seen", True)
        for stream in streams.values():
            assert stream["carrier"] == "trailer"
            assert stream["rendered"] > 0
            assert (stream["violations"], stream["unstamped"]) == (0, 0)

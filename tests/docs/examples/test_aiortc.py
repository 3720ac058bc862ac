"""The client of docs/examples/aiortc, which has nothing but aiortc, drives a real console and watches it."""

import asyncio
import json
import re
import sys
from pathlib import Path

from tests.server.rig import PATIENCE, running_rig

SCRIPT = Path(__file__).parents[3] / "docs" / "examples" / "aiortc" / "drive.py"


async def test_plain_aiortc_drives_and_decodes_pictures() -> None:
    async with running_rig() as rig:
        link = f"{rig.url}/#token={rig.access.issue('operator', 'operator')}"
        script = await asyncio.create_subprocess_exec(
            sys.executable, str(SCRIPT), link, "--seconds", "5", stdout=asyncio.subprocess.PIPE
        )
        try:
            async with asyncio.timeout(2 * PATIENCE):
                printed, _ = await script.communicate()
        finally:
            if script.returncode is None:
                script.kill()
                await script.wait()
        assert script.returncode == 0
        found = json.loads(printed.splitlines()[-1])
        assert found["event"] > 5  # a busy machine executes and decodes few in these seconds
        assert found["pictures"] > 5
        assert rig.dependencies.console.clock.event == found["event"]
        axes = [json.loads(axes + b"]") for axes in re.findall(rb"axes (.*?)\]", printed)]
        assert max(max(each) for each in axes) > 0
        assert not list(rig.dependencies.console.peers)

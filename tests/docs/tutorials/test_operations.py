"""docs/tutorials/operations.md with the real bridge, console, Caddy, coturn and Prometheus.

The wheels are not built and installed once more: tests/wheels/ does that. `console/` is the tests' own environment.
"""

import re
from pathlib import Path

import pytest

from tests.docs.tutorials.reader import ROOT, Reader

pytestmark = [pytest.mark.long, pytest.mark.timeout(500)]


async def test_a_reader_gets_from_the_wheels_to_a_bridge_that_died(tmp_path: Path) -> None:
    (tmp_path / "console").symlink_to(ROOT / ".venv")
    reader = Reader("operations", tmp_path)
    reader.take("make dist\npython3 -m venv console")
    reader.compare(await reader.run("PATH="))
    bridge = reader.take("umask 077\nhead") + f" --port {reader.port('5600')}"
    start_again = bridge.splitlines()[-1]
    bridge += " & echo $! > bridge.pid; wait"
    listening = f"--port {reader.port('8000')}"
    async with reader.process(bridge, "tcp://") as said:
        reader.compare(said)
        async with reader.process(f"{reader.take('lockstep serve')} {listening}", "Ctrl-C"):
            reader.compare(await reader.run("curl -s -w"))
            async with reader.running("LOCKSTEP_SITE=localhost", "serving initial configuration"):
                reader.compare(await reader.run("curl -sk -w"))
        async with reader.running("umask 077\nhead -c 32 /dev/urandom | base64 > turn_secret", "IO method"):
            console = reader.take("LOCKSTEP_TURN_SECRET_FILE") + f" {listening}"
            async with reader.process(console, "Ctrl-C"):
                reader.compare(await reader.run("LINK="))
                await _watch_and_judge(reader)
                reader.take("console/bin/pip install --upgrade")  # there are no wheels here
                await reader.type('kill -KILL "$(cat bridge.pid)"')
                health = reader.take("curl -s -w")
                await reader.type(f"until {health} | tee health | grep -q degraded; do sleep 0.1; done")
                reader.compare((tmp_path / "health").read_text())
                async with reader.process(start_again, "tcp://") as said:
                    reader.compare(said)
    assert reader.left == []


async def _watch_and_judge(reader: Reader) -> None:
    said = await reader.run("lockstep invite")
    reader.compare(said)
    (ada,) = re.findall(r"^([0-9a-f]{16}) .* Ada$", said, re.MULTILINE)
    reader.values = {r"4b78c86991e5013c": ada}
    reader.compare(await reader.run("lockstep revoke"))
    async with reader.running("promtool check config", "Server is ready"):
        await reader.type(f"until {reader.take('promtool query')} | tee asked | grep -q .; do sleep 0.2; done")
        reader.compare((reader.folder / "asked").read_text())
    reader.compare(await reader.run("lockstep audit"))

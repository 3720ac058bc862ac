"""docs/tutorials/own-robot.md: the template's own test, and both bridges under `lockstep check`.

What the template does under a console is tested in tests/robot_bridge/new_robot/test_new_robot.py.
"""

from pathlib import Path

import pytest

from tests.docs.tutorials.reader import Reader

pytestmark = [pytest.mark.long, pytest.mark.timeout(500)]


async def test_a_reader_gets_from_the_template_to_a_checked_bridge_in_two_languages(tmp_path: Path) -> None:
    reader = Reader("own-robot", tmp_path)
    ports = f"--port {reader.port('8000')} --robot-port {reader.port('5600')}"
    async with reader.process(f"{reader.take('lockstep robot new my_arm')} {ports}", "To drive"):
        assert (tmp_path / "my_arm" / "my_arm" / "robot.py").is_file()
    test, bridge = reader.take("python -m pytest").splitlines()
    assert "3 passed" in await reader.type(f"cd my_arm && {test} -p no:cacheprovider")
    async with reader.process(f"cd my_arm && {bridge} --port {reader.port('5600')}", "tcp://"):
        reader.compare(await reader.run("lockstep check"))
    async with reader.running("cc -O2", "tcp://"):
        check, console = reader.take("lockstep check").splitlines()
        assert "40 ok, 20 not applicable" in await reader.type(check)
        async with reader.process(f"{console} --port {reader.port('8000')}", "To drive"):
            assert '"robot_link":"up"' in await reader.type(f"curl -s http://127.0.0.1:{reader.port('8000')}/healthz")
    assert reader.left == []

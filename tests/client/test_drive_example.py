import asyncio
import re
import sys
from pathlib import Path

import pytest

from tests.client.live.truth import until_logged
from tests.support.stack import Stack

pytestmark = pytest.mark.asyncio(loop_scope="module")

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "drive.py"
TRIES = 5
LINE = re.compile(r"event (\d+): picture (\d+), gap (-?\d+), ([\d.]+) N, ([\d.]+) m")


async def _run(link: str) -> tuple[int | None, str, str]:
    """Its exit code, and what it said."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, str(EXAMPLE), link),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=EXAMPLE.parents[2],
    )
    try:
        async with asyncio.timeout(100):
            output, trouble = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    return process.returncode, output.decode(), trouble.decode()


async def test_the_script_of_the_readme_drives_until_something_is_near(stack: Stack) -> None:
    output = ""
    for _ in range(TRIES):
        code, said, trouble = await _run(stack.operator)
        output += said
        if code == 0:
            break
        # A busy machine held up the robot: the script says so and its user starts it again.
        assert (code, trouble.startswith("not_neutral: ")) == (1, True), trouble
    else:
        raise AssertionError(f"held up {TRIES} times")
    lines = [LINE.fullmatch(line) for line in output.splitlines()]
    seen = [match.groups() for match in lines if match is not None]
    assert len(seen) == len(lines) > 10
    assert all(abs(int(gap)) <= 4 for _, _, gap, _, _ in seen)
    assert float(seen[-1][3]) > 20 or float(seen[-1][4]) <= 0.5
    last = int(seen[-1][0])
    await until_logged(stack, "feedback", lambda record: record["event"] >= last and record["at_rest"])

import sys

from lockstep.bench.harness.processes import running_process

COUNTING = """
import asyncio, itertools
from lockstep.bench.harness.asked import answer, say

say({"ready": True})
numbers = itertools.count(1)
asyncio.run(answer(lambda: {"number": next(numbers)}))
say({"ended": True})
"""


async def test_each_question_is_answered_until_the_questions_end() -> None:
    async with running_process(sys.executable, "-c", COUNTING) as (process, ready):
        assert ready == {"ready": True}
        assert await process.ask("one", 10) == {"number": 1}
        assert await process.ask("two", 10) == {"number": 2}
        assert process.process.stdin is not None
        process.process.stdin.close()
        assert await process.read(10) == {"ended": True}
        assert await process.wait() == 0

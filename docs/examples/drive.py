"""Drive forward until something is touched or near: python docs/examples/drive.py LINK"""

import asyncio
import math
import sys

from lockstep.client import Console, ConsoleError


async def main(link: str) -> None:
    async with Console(link) as console:
        await console.take_seat()
        async for picture in console.pictures():
            feedback = await console.drive({"base.vx": 0.3})
            force, near = math.hypot(*feedback.wrench[:3]), min(feedback.ranges)
            print(f"event {feedback.event}: picture {picture.stamp}, gap {picture.gap}, {force:.1f} N, {near:.2f} m")
            if force > 20 or near < 0.5:
                break
        await console.rest()


try:
    asyncio.run(main(sys.argv[1]))
except ConsoleError as error:  # the robot was stopped or held up, somebody else drives, …: look, then start it again
    sys.exit(str(error))

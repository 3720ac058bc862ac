"""An observer that reports the age of pictures when they are rendered.

`python -m lockstep.bench.relay.delays LINK direct|relay`.

It prints every second a JSON line with the ages since capture, in ms. All processes share one machine and so one clock.
"""

import asyncio
import json
import sys

from lockstep.client import Console

__all__ = ["main"]


async def watch(link: str, through_relay: bool) -> None:
    async with Console(
        link, through_relay=through_relay, carrier="trailer", video=1, audio=False, name="delays", tolerance=1000
    ) as console:
        camera = console.description.cameras[0].name
        told = 0.0
        while True:
            await asyncio.sleep(1.0)
            new = [each for each in console.rendered(camera) if each.at > told]
            told = new[-1].at if new else told
            ages = [round(each.age * 1000, 3) for each in new if each.age is not None]
            print(json.dumps({"relay": console.relay, "ages_ms": ages}), flush=True)


def main() -> None:
    asyncio.run(watch(sys.argv[1], sys.argv[2] == "relay"))


if __name__ == "__main__":
    main()

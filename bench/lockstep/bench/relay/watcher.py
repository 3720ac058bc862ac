"""A headless observer in a separate process: `python -m lockstep.bench.relay.watcher LINK PICTURES`.

It watches where the console sends it, reads this many pictures, and prints one JSON line about them.
"""

import asyncio
import json
import sys

from lockstep.client import Console

__all__ = ["main"]


async def watch(link: str, pictures: int) -> dict[str, object]:
    async with Console(link, through_relay=True, name="watcher") as console:
        seen = 0
        async for _ in console.pictures():
            seen += 1
            if seen >= pictures:
                break
        statistics = console.stats()
        note = await console.note("seen")
        stopped = await console.stop("an observer says so")
        return {
            "event": statistics.event,
            "relay": console.relay,
            "line": type(console._live().transport).__name__,
            "note": note.text,
            "stopped": stopped.stopped,
            "streams": {
                each.stream: {
                    "carrier": each.carrier,
                    "codec": each.codec,
                    "rendered": each.rendered,
                    "max_gap": each.max_gap,
                    "violations": each.violations,
                    "unstamped": each.unstamped,
                }
                for each in statistics.streams
            },
        }


def main() -> None:
    print(json.dumps(asyncio.run(watch(sys.argv[1], int(sys.argv[2])))), flush=True)


if __name__ == "__main__":
    main()

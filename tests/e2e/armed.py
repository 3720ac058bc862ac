"""Arms on a machine that may be busy with other things."""

from lockstep.bench.browsers.console_page import ConsolePage

__all__ = ["arm_at_rest"]

TRIES = 5


async def arm_at_rest(console: ConsolePage) -> None:
    """Let go of everything and arm, with the robot at rest; again if a busy machine ended that."""
    await console.until_live()
    await console.pad.let_go()
    for _ in range(TRIES):
        if not (await console.stats())["armed"]:
            await console.arm()
        await console.until("s.at_rest === true")
        if (await console.stats())["armed"]:
            return
    raise AssertionError("it does not stay armed")

"""The gamepad of a page, as `test_pad.js` makes it."""

from types import MappingProxyType

from playwright.async_api import Page

__all__ = ["FORWARD", "LEFT_X", "LEFT_Y", "RB", "RIGHT_X", "ROUND", "START", "STOP_BUTTON", "Pad"]

START, RB, STOP_BUTTON = 9, 5, 1  # W3C standard mapping
LEFT_X, LEFT_Y, RIGHT_X = 0, 1, 2
FORWARD = MappingProxyType({LEFT_Y: -1.0})
ROUND = MappingProxyType({LEFT_Y: -1.0, RIGHT_X: -1.0})  # the planar robot in a circle of half a metre: it stays near


class Pad:
    """The operator's fingers on the pad."""

    def __init__(self, page: Page) -> None:
        self._page = page

    async def press(self, button: int, pressed: bool = True) -> None:
        """Press as a finger does: no shorter than the page's sampling can see."""
        await self._page.evaluate(
            "([button, pressed]) => { window.testPad.press(button, pressed); return window.testPad.seen(); }",
            [button, pressed],
        )

    async def tilt(self, axis: int, value: float) -> None:
        await self._page.evaluate("([axis, value]) => window.testPad.tilt(axis, value)", [axis, value])

    async def let_go(self) -> None:
        """Let go of the deadman and the sticks."""
        await self.press(RB, False)
        for axis in ROUND:
            await self.tilt(axis, 0)

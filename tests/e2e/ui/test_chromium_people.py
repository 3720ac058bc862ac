"""Names, notes, invitations and the audit trail, from page to page."""

import re

import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


# What can have the focus while a dialogue is open: it, and what has to stay in reach.
REACHABLE = """(() => {
  const focused = document.activeElement;
  return focused === document.body || focused.closest("dialog, .seat, .banner, .stop") !== null;
})()"""


async def _tab(console: ConsolePage, name: str) -> None:
    await console.page.get_by_role("tab", name=name).click()


def _dialogue(console: ConsolePage) -> Locator:
    return console.page.get_by_role("dialog")


async def _invite(console: ConsolePage, role: str, name: str) -> str:
    """Opens the dialogue if it is shut, makes a link and returns it."""
    if await _dialogue(console).count() == 0:
        await _tab(console, "People")
        await console.page.get_by_role("button", name="Invite…").click()
    dialogue = _dialogue(console)
    await dialogue.get_by_role("button", name=role, exact=True).click()
    await dialogue.get_by_label("Name").fill(name)
    await dialogue.get_by_label("Good for").select_option("1 hour")
    await dialogue.get_by_role("button", name="Create link").click()
    await dialogue.get_by_text(f"Anyone who opens this link is {name} ({role.lower()})").wait_for()
    return await dialogue.get_by_role("textbox", name="Link").input_value()


async def test_a_note_reaches_everyone_with_its_event_and_counts_as_unread(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator + "&name=Ann") as ann,
        open_console(chromium, stack.observer + "&name=Dee", pad=False) as dee,
    ):
        await ann.until("s.connected && s.event !== null")
        await dee.until("s.connected && s.event !== null")
        await _tab(dee, "Notes")
        await dee.page.get_by_label("Note to everyone").fill("The gripper slips")
        await dee.page.keyboard.press("Enter")
        await dee.page.get_by_text("The gripper slips").wait_for()
        await ann.page.locator(".tab[data-calls=true]", has_text="Notes").get_by_text("1").wait_for()
        await _tab(ann, "Notes")
        note = ann.page.get_by_role("listitem").filter(has_text="The gripper slips")
        await note.get_by_text("Dee").wait_for()
        told = re.search(r"event ([\d\u202f]+)", await note.inner_text())  # a narrow space between thousands
        assert told is not None
        assert int(told[1].replace("\u202f", "")) == (await ann.stats())["event"]
        await ann.page.locator(".tab[data-calls=false]", has_text="Notes").wait_for()


async def test_writing_a_note_lets_go_of_the_robot_and_its_keys_do_not_drive(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await _tab(console, "Notes")
        await console.arm()
        await console.drive_forward()
        field = console.page.get_by_label("Note to everyone")
        await field.click()
        await console.until("!s.armed && s.at_rest === true")
        executed = len(await stack.events("executed"))
        await console.page.keyboard.press("Enter")  # arms elsewhere
        await console.page.keyboard.type(" wasd ")
        await console.pad.press(9)  # START: refused while a text field has the keyboard
        await console.page.keyboard.press("Backspace")  # stops elsewhere
        statistics = await console.stats()
        assert not statistics["armed"]
        assert not statistics["stop"]["stopped"]
        await expect(field).to_have_value(" wasd")
        moving = [each for each in (await stack.events("executed"))[executed:] if any(each["values"])]
        assert moving == []
        await console.page.keyboard.press("Escape")
        await console.until("s.stop.stopped")


async def test_a_new_name_is_seen_by_others_and_outlives_a_reload(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator) as ann,
        open_console(chromium, stack.observer, pad=False) as dee,
    ):
        await ann.until("s.connected && s.seat && s.seat.mine")
        await dee.until("s.connected")
        await _tab(ann, "People")
        await ann.page.get_by_role("button", name="Change your name").click()
        await ann.page.get_by_label("Your name").fill("Ann")
        await ann.page.keyboard.press("Enter")
        await dee.until("s.seat && s.seat.name === 'Ann'")
        await ann.page.reload()
        await ann.until("s.connected && s.seat && s.seat.mine && s.seat.name === 'Ann'")
        await _tab(dee, "People")
        people = dee.page.get_by_role("region", name="People").get_by_role("listitem")
        await people.filter(has_text="Ann").get_by_text("drives").wait_for()
        await people.filter(has_text="observer").get_by_text("you").wait_for()


async def test_an_invited_person_comes_in_by_link_or_qr_code_and_leaves_when_it_is_revoked(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.supervisor, pad=False) as sue:
        await sue.until("s.connected")
        link = await _invite(sue, "Observer", "Guest")
        assert link.startswith(own_stack.console)
        code = _dialogue(sue).get_by_role("img", name="QR code of the link")
        box = await code.bounding_box()
        assert box is not None
        assert box["width"] > 150
        async with open_console(chromium, link, pad=False) as guest:
            await guest.until("s.connected && s.role === 'observer'")
            line = _dialogue(sue).get_by_role("listitem").filter(has_text="Guest")
            await line.get_by_text("1 connected").wait_for()
            await line.get_by_role("button", name="Revoke").click()
            await line.get_by_text("Close their page?").click()
            await line.get_by_text("revoked").wait_for()
            await guest.page.locator(".plate").get_by_text("This link was revoked").wait_for()
            await guest.until("!s.connected")
            await expect(guest.page.locator("canvas.picture").first, "no picture is left to look at").to_be_hidden()
        async with open_console(chromium, link, pad=False) as late:
            await late.page.locator(".plate").get_by_text("This link was revoked").wait_for()


async def test_an_operator_invites_observers_and_operators_only(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator, pad=False) as ann,
        open_console(chromium, stack.observer, pad=False) as dee,
    ):
        await ann.until("s.connected")
        await dee.until("s.connected")
        await _invite(ann, "Operator", "Ben")
        await expect(_dialogue(ann).get_by_role("button", name="Supervisor", exact=True)).to_have_count(0)
        for _ in range(12):
            await ann.page.keyboard.press("Tab")
            assert await ann.page.evaluate(REACHABLE), "focus left the dialogue for something that it covers"
        await _dialogue(ann).get_by_role("button", name="Close").click()
        await ann.until("document.activeElement === document.body")  # the keyboard is the robot's again
        await ann.page.get_by_role("button", name="Invite…").press("Enter")
        await _dialogue(ann).get_by_role("button", name="Close").press("Enter")
        await ann.until("document.activeElement.textContent === 'Invite…'")
        await _tab(dee, "People")
        await expect(dee.page.get_by_role("button", name="Invite…")).to_have_count(0)


async def test_a_supervisor_reads_the_audit_trail_as_it_grows(own_stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, own_stack.supervisor + "&name=Sue", pad=False) as sue,
        open_console(chromium, own_stack.operator + "&name=Ann") as ann,
    ):
        await sue.until("s.connected")
        await ann.until("s.connected && s.seat && s.seat.mine")
        await _tab(sue, "People")
        await sue.page.get_by_role("button", name="Audit trail…").click()
        rows = _dialogue(sue).get_by_role("row")
        await rows.filter(has_text="seat").filter(has_text="Ann").first.wait_for()
        await ann.page.keyboard.press("Escape")
        await rows.filter(has_text="stop").filter(has_text="Ann").first.wait_for()
        await _dialogue(sue).get_by_role("button", name="Stops").click()
        await rows.filter(has_text="seat").first.wait_for(state="detached")
        stop = rows.filter(has_text="stop key").first
        assert f"{(await sue.stats())['event']}" in (await stop.inner_text()).replace("\u202f", "")

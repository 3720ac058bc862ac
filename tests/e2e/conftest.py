"""A console with the planar robot, browsers, and a sound card that can be listened to, for each test."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from playwright.async_api import Browser

from bench.browsers.chromium import running_chromium
from bench.browsers.firefox import Firefox, running_firefox
from bench.browsers.sound_card import SoundCard, running_sound_card
from tests.support.stack import Stack, running_stack


@pytest.fixture
async def stack(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path) as running:
        yield running


@pytest.fixture
async def sound_card(tmp_path: Path) -> AsyncIterator[SoundCard]:
    async with running_sound_card(tmp_path) as card:
        yield card


@pytest.fixture
async def chromium(sound_card: SoundCard) -> AsyncIterator[Browser]:
    async with running_chromium(sound_card.environment) as browser:
        yield browser


@pytest.fixture
async def firefox(sound_card: SoundCard) -> AsyncIterator[Firefox]:
    async with running_firefox(sound_card.environment) as browser:
        yield browser

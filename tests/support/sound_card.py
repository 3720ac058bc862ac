from bench.browsers.sound_card import *  # noqa: F403

from bench.browsers.console_page import *  # noqa: F403

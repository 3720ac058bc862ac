from bench.browsers.chromium import *  # noqa: F403

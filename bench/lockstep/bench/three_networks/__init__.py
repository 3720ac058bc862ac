"""A robot, a console and a page, each behind a router of its own: paired by code, and driven."""

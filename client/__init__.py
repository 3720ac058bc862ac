"""A console without a browser, for scripts, tests and policies."""

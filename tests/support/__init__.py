"""Real parts for the tests: whole consoles, browsers and the bridge's own record of what was true."""

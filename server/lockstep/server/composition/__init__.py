"""One console put together: its apps, each robot's session, and the process that serves them."""

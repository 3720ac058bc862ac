"""The robot link's protocol and the console's messages: no I/O, no dependencies but msgspec."""

"""The server that the console is compared with."""

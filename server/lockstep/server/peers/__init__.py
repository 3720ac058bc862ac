"""The connected operators and observers, and the messages from and to them."""

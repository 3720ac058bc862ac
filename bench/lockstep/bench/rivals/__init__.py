"""Other consoles, reduced to the compared part: they send pictures of the same robot bridge in their own way."""

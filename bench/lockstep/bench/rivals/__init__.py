"""Other consoles, reduced to the compared part: pictures of the same robot bridge, sent in their way."""

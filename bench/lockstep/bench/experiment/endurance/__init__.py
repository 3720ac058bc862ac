"""Sessions of hours: whether the console gives one up by itself."""

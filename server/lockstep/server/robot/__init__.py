"""The console's connection to a robot bridge."""

"""Several consoles behind one entry: what they tell each other, and through what (docs/fleet.md)."""

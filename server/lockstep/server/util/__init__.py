"""Small parts that know nothing of robots or consoles."""

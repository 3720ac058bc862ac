"""Small utilities that know nothing of robots or consoles."""

"""Real browsers and a real sound card, for measurements and tests."""

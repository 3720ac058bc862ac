"""Real browsers and a real sound card, for whoever measures or tests with them."""

"""What the micromanipulator does by itself when it is asked."""

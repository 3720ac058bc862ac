"""How long the page takes to open and to show its first picture."""

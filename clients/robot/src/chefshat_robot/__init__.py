"""Chef's Hat at a real table: printable cards, a camera that reads them, and robots that play."""

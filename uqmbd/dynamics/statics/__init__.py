"""Static equilibria, modes about them, and outputs without a time."""

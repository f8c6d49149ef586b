"""The linear system of accelerations and multipliers, and its solvers."""

"""Studies of convergence, and convergence of samples within a study."""

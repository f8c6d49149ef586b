"""Choice of a method: error against cost of every method, for forty mechanisms with converged references."""

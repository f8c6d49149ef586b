"""Statistics of samples: moments, angles, rotations, replicates, and what varies."""

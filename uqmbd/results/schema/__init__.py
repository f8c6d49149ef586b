"""The layout of results: axes, datasets, nodes of the tree, and their validation."""

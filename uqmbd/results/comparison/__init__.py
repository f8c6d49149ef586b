"""Comparison of methods: alignment, distances, errors, verdicts, recommendation."""

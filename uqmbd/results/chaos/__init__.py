"""Polynomial chaos as data: evaluation, statistics, sampling, stated errors, storage."""

"""Expressions of time, inputs and quantities without a time, and what users may give as values."""

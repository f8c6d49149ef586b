"""Integration without events: explicit in lock-step, and implicit by IDA."""

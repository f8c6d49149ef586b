"""Consistent initial states, and which equations are independent."""

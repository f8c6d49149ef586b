"""Spaces, frames and rotations."""

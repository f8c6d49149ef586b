"""Drawings of a mechanism: its picture, its poses, its animation."""

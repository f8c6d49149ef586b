"""Galerkin projection of an ensemble: its equations and their integration."""

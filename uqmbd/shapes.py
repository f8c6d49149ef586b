"""Shapes of bodies: ``mechanism.body(..., shape=uqmbd.shapes.Box((0.1, 0.2, 0.3)))``.

Shapes are drawn, and define distances between bodies.  They do not affect the motion: give mass and inertia separately.
Lengths and positions may be expressions in random variables.

Examples
--------
>>> import uqmbd
>>> mechanism = uqmbd.Mechanism("crate", uqmbd.Spatial())
>>> box = Box((1, 1, 2))
>>> crate = mechanism.body("crate", mass=3, inertia=(1.25, 1.25, 0.5), shape=box)
>>> crate.shapes
(Box(size=(1, 1, 2)),)
"""

from __future__ import annotations

from uqmbd.mechanism import BodyShape, Box, Capsule, Cylinder, Mesh, Sphere

__all__ = ["Box", "Capsule", "Cylinder", "Mesh", "BodyShape", "Sphere"]

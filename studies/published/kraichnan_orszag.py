"""The Kraichnan-Orszag problem as a free rigid body near its middle axis: aligned elements stay accurate over time.

The Kraichnan-Orszag problem is a standard test of polynomial chaos over long times: three equations without damping,

    y1' = y1 y3,    y2' = -y2 y3,    y3' = y2^2 - y1^2,

from y = (1, 0.1 xi, 0), xi ~ Uniform(-1, 1) (X. Wan and G. E. Karniadakis, Journal of Computational Physics 209 (2005)
617-642).  With z1 = (y1 + y2) / sqrt(2), z2 = (y1 - y2) / sqrt(2), z3 = y3 they read

    z1' = z2 z3,    z2' = z1 z3,    z3' = -2 z1 z2.

These are the Euler equations of a free body with principal moments of inertia A < B < C,

    A wa' = (B - C) wb wc,    B wb' = (C - A) wc wa,    C wc' = (A - B) wa wb,

with scaled rates.  z1 = sa wa, z2 = sc wc, z3 = -sb wb satisfy them if sa (C - B) / A = sb sc,
sc (B - A) / C = sa sb and sb (C - A) / B = 2 sa sc, so that

    sa^2 = (B - A) (C - A) / (2 B C),    sb^2 = (C - B) (B - A) / (A C),    sc^2 = (C - B) (C - A) / (2 A B).

Any body with three different moments of inertia is suitable.  This study uses a sheet of paper of the A series.  A
uniform plate with sides in the ratio sqrt(2) to 1 has A : B : C = 1 : 2 : 3.  The middle axis is parallel to the short
side, and sa^2 = 1 / 6, sb^2 = 1 / 3, sc^2 = 1 / 2.

For xi = 0 the body approaches the steady rotation about the middle axis, and never leaves it (y3 = -tanh t).  On either
side it turns over repeatedly, about its long side (xi > 0) or about its normal (xi < 0).  The period grows like
-log |xi|: a separatrix divides the range of the input at its middle.  With h = 0.1 |xi|, u = (1 + h) t and
m = ((1 - h) / (1 + h))^2 the exact solution in Jacobi elliptic functions is

    y1 = ((1 + h) dn u + (1 - h) cn u) / 2,    y2 = +-((1 + h) dn u - (1 - h) cn u) / 2,    y3 = -(1 - h) sn u.

An expansion at equal times fails after some seconds; many elements only delay the failure.  An expansion at equal phase
of the oscillation of y3 uses elements that become smaller towards the separatrix.  Its statistics stay accurate to
t = 100 and beyond.
"""

import chaospy
import numpy as np
import sympy
from scipy.special import ellipj

import uqmbd
from uqmbd_collocation import Collocation

A, B, C = 1.0, 2.0, 3.0  # kg m^2
SCALE_A = np.sqrt((B - A) * (C - A) / (2 * B * C))
SCALE_B = np.sqrt((C - B) * (B - A) / (A * C))
SCALE_C = np.sqrt((C - B) * (C - A) / (2 * A * B))
OFFSET = 0.1
"""Initial value of y2 for xi = 1."""


def body_rates(y1, y2, y3):
    """Return rates about the axes of the smallest, the middle and the largest moment of inertia, rad/s."""
    z1, z2 = (y1 + y2) / sympy.sqrt(2), (y1 - y2) / sympy.sqrt(2)
    return z1 / SCALE_A, -y3 / SCALE_B, z2 / SCALE_C


def exact(times, xi):
    """Return (y1, y2, y3) at the times (T,) for values of the input (K,), shape (K, 3, T)."""
    h = OFFSET * np.abs(np.asarray(xi, dtype=float))[:, None]
    sn, cn, dn, _ = ellipj((1 + h) * times, ((1 - h) / (1 + h)) ** 2)
    sum_, difference = (1 + h) * dn, (1 - h) * cn
    side = np.sign(np.asarray(xi, dtype=float))[:, None]
    return np.stack([(sum_ + difference) / 2, side * (sum_ - difference) / 2, -(1 - h) * sn], axis=1)


def reference(times, halvings=30, points=48):
    """Return mean and standard deviation (3, T) of the exact solution, by Gauss rules on parts halving towards 0."""
    ends = 2.0 ** np.arange(-halvings, 1)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    half = np.diff(ends)[:, None] / 2
    xi = ((ends[:-1, None] + half) + half * nodes).ravel()
    share = np.concatenate([half * weights / 2] * 2).ravel()
    found = exact(times, np.concatenate([xi, -xi]))
    mean = np.einsum("k,kot->ot", share, found)
    return mean, np.sqrt(np.einsum("k,kot->ot", share, (found - mean) ** 2))


xi = uqmbd.RandomVariable("xi", chaospy.Uniform(-1, 1))

mechanism = uqmbd.Mechanism("kraichnan_orszag", uqmbd.Spatial(gravity=(0, 0, 0)))
sheet = mechanism.body("sheet", mass=1.0, inertia=(A, B, C), angular_velocity=body_rates(1, OFFSET * xi, 0))
about_long, about_middle, about_normal = sheet.rotation.T * sheet.angular_velocity
mechanism.output("y1", (SCALE_A * about_long + SCALE_C * about_normal) / sympy.sqrt(2), units="1")
mechanism.output("y2", (SCALE_A * about_long - SCALE_C * about_normal) / sympy.sqrt(2), units="1")
mechanism.output("y3", -SCALE_B * about_middle, units="1")

study = uqmbd.Study(
    "kraichnan_orszag",
    mechanism,
    times=np.linspace(0, 100, 1001),
    rtol=1e-8,
    propagators=[
        Collocation(order=7, elements=32, label="plain"),
        Collocation(order=7, elements=32, alignment="phase", clock="y3", label="aligned"),
    ],
)

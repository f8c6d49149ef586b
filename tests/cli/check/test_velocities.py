"""What `uqmbd check` says of a mechanism whose velocities have fewer degrees of freedom than its positions."""

from __future__ import annotations

SCRIPT = """
import uqmbd
from uqmbd_joints import Skate
mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
body = mechanism.body("sleigh", mass=1, inertia=0.1, com=(0.3, 0), velocity=(1, 0), angular_velocity=1)
mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
mechanism.output("x", body.position[0], units="m")
study = uqmbd.Study("sleigh", mechanism, [0, 1])
"""


def test_check_tells_both_degrees_of_freedom(command_line, tmp_path):
    (tmp_path / "sleigh.py").write_text(SCRIPT)
    status, told, _ = command_line("check", "sleigh.py")
    assert not status
    assert "mobility    3 degrees of freedom of the positions, 2 of the velocities" in told
    assert "2 constraint equations, 2 of them independent; one is the unit length" in told

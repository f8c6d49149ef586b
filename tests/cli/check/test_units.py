"""`uqmbd check` tells what is wrong with units."""

SCRIPT = """
import warnings
import uqmbd
from uqmbd_montecarlo import MonteCarlo
import chaospy
warnings.simplefilter("ignore", uqmbd.UnitsWarning)
mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
stone = mechanism.body("stone", mass=uqmbd.RandomVariable("m", chaospy.Uniform(1, 2), units="kg"))
mechanism.output("height", stone.position[0], units="{units}")
study = uqmbd.Study("fall", mechanism, times=[0, 1], propagators=[MonteCarlo(samples=2, seed=1)])
"""


def test_check_tells_findings_and_nothing_where_there_are_none(command_line, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(units="N"))
    status, out, _ = command_line("check", "script.py")
    assert status == 0
    assert "Warning: output 'height': stone.x is in m, but its declared units are N;" in " ".join(out.split())
    script.write_text(SCRIPT.format(units="m"))
    status, out, _ = command_line("check", "script.py")
    (line,) = [x for x in out.splitlines() if x.startswith(("Warning: ", "Note: "))]
    assert status == 0 and "random input 'm'" in line

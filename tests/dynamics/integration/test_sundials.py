"""What SUNDIALS says or does when it fails neither reaches the terminal nor ends the process."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics.integration.sundials import solve
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce


def run(text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", textwrap.dedent(text)], capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_a_sparse_solver_that_stops_before_its_first_matrix_does_not_end_the_process():
    """Its memory is then not whole, and to free it was a segmentation fault."""
    done = run("""
        import numpy as np
        from scipy import sparse
        from uqmbd.dynamics.integration.sundials import solve

        def decay(t, y, yp, res):
            res[:] = yp + y

        def raising(t, y, yp, res):
            raise ValueError("no such force")

        def lost(t, y, yp, res):
            res[:] = np.nan

        def jacobian(t, y, yp, res, c, jac):
            jac[:] = c + 1

        long, short = np.array([0, 0.5, 1]), np.array([0, 1e-320, 2e-320])
        for residual, times, rate in (
            (decay, long, 1), (decay, long, 1e99), (decay, long, 1e200), (decay, short, 1), (raising, long, 1), (lost, long, 1)
        ):
            for _ in range(5):
                options = dict(jacfn=jacobian, linsolver="sparse", sparsity=sparse.identity(200, format="csc"))
                try:
                    found = solve(residual, options, times, np.ones(200), -rate * np.ones(200), rtol=1e-6, atol=1e-6)
                except ValueError as error:
                    found = error
            print(getattr(found, "success", None), getattr(found, "message", found))
    """)
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stderr == ""
    decay, _, fast, short, raising, lost = done.stdout.splitlines()
    assert decay == "True "
    assert fast.startswith("False rates up to 1e+200 at the start")
    assert short.startswith("False The value tstop")
    assert raising == "None no such force"
    assert lost.startswith("False At t = 0")


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_ctrl_c_in_the_middle_of_an_integration_is_a_keyboard_interrupt():
    done = run("""
        import os, signal
        import numpy as np
        from scipy import sparse
        from uqmbd.dynamics.integration.sundials import solve

        def residual(t, y, yp, res):
            os.kill(os.getpid(), signal.SIGINT)
            res[:] = yp + y

        def jacobian(t, y, yp, res, c, jac):
            jac[:] = 0

        signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background may ignore it
        for options in ({"linsolver": "dense"}, {"linsolver": "sparse", "sparsity": sparse.identity(200, format="csc")}):
            times = np.array([0, 0.5, 1])
            try:
                solve(residual, options | {"jacfn": jacobian}, times, np.ones(200), -np.ones(200), rtol=1e-6, atol=1e-6)
            except KeyboardInterrupt:
                print("interrupted")
            assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    """)
    assert (done.returncode, done.stdout) == (0, "interrupted\ninterrupted\n"), done.stderr[-500:]


@pytest.mark.thorough
def test_what_sundials_says_is_in_the_message_and_nowhere_else(capfd):
    """A force without bound: no step is small enough."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=(0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.add(PointForce("push", rod, (0.5, 0), (0, 1 / (0.05 - uqmbd.t) ** 3)))
    mechanism.output("angle", rod.angle, units="rad")
    with pytest.raises(uqmbd.IntegrationError, match=r"stopped at t = 0\.0[45]\d* s \(At t = .*step"):
        uqmbd.simulate(mechanism, [0, 0.03, 0.1], integrator="ida")
    heard = capfd.readouterr()
    assert heard.out == "" and heard.err == ""


def test_other_threads_print_while_one_integrates(capsys):
    import threading

    said = threading.Event()

    def residual(t, y, yp, res):
        if not said.is_set():
            other = threading.Thread(target=lambda: print("from elsewhere"))
            other.start()
            other.join()
            said.set()
            print("from SUNDIALS")
        res[:] = yp + y

    options = {"linsolver": "dense"}
    before = sys.stdout
    assert solve(residual, options, np.array([0, 0.5, 1.0]), np.ones(2), -np.ones(2), rtol=1e-6, atol=1e-6).success
    assert sys.stdout is before
    assert capsys.readouterr().out == "from elsewhere\n"

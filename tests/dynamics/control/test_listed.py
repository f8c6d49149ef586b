"""Controllers are listed where a mechanism is described."""

import uqmbd
from uqmbd_springs import PointForce


def push(time, measured):
    return 1 - measured


def test_check_results_and_notebooks_list_them():
    mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    cart = mechanism.body("cart", mass=1)
    controller = mechanism.add(
        uqmbd.Controller("servo", measured=["x"], commanded={"force": "N"}, rate=50, delay=0.002, function=push)
    )
    mechanism.add(PointForce("motor", cart, 0, controller.command()))
    mechanism.output("x", cart.position, units="m")
    assert uqmbd.check(mechanism).controllers == (("servo", "50 Hz, commands act 0.002 s later", "x", "force (N)"),)
    page = mechanism._repr_html_()
    assert "Controllers" in page and "servo" in page and "50" in page
    assert repr(controller) == "<Controller 'servo': force; 50 Hz>"

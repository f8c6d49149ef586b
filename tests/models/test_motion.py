"""Models written here move as MuJoCo's accelerations say: followers, coupled hinges, loops, balls, slides, free bodies.

`test_corpus.py` compares public models in the same way.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import uqmbd

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

ROD = '<geom type="capsule" size=".02" fromto="0 0 0 .3 0 .05" density="2700"/>'

MODELS = {
    "hinge that follows a hinge": f"""
        <worldbody>
          <body name="a"><joint name="qa" axis="0 1 0"/>{ROD}</body>
          <body name="b" pos="0 .2 0"><joint name="qb" axis="0 1 0"/>{ROD}</body>
        </worldbody>
        <equality><joint joint1="qb" joint2="qa" polycoef="0 -0.5 0 0 0"/></equality>""",
    "follower before its leader, by a polynomial": f"""
        <worldbody>
          <body name="b" pos="0 .2 0"><joint name="qb" axis="0 1 0"/>{ROD}</body>
          <body name="a"><joint name="qa" axis="0 1 0" damping=".02"/>{ROD}</body>
        </worldbody>
        <equality><joint joint1="qb" joint2="qa" polycoef="0 0.7 0.4 -0.2 0.1"/></equality>""",
    "chain of followers": f"""
        <worldbody>
          <body name="a"><joint name="qa" axis="0 1 0"/>{ROD}
            <body name="b" pos=".3 0 0"><joint name="qb" axis="0 1 0"/>{ROD}
              <body name="c" pos=".3 0 0"><joint name="qc" axis="0 1 0"/>{ROD}</body></body></body>
        </worldbody>
        <equality>
          <joint joint1="qc" joint2="qb" polycoef="0 1 0 0 0"/><joint joint1="qb" joint2="qa" polycoef="0 -1 0 0 0"/>
        </equality>""",
    "slide that follows a hinge": f"""
        <worldbody>
          <body name="a"><joint name="qa" axis="0 1 0"/>{ROD}</body>
          <body name="s" pos="0 .2 0"><joint name="qs" type="slide" axis="1 0 0"/>{ROD}</body>
        </worldbody>
        <equality><joint joint1="qs" joint2="qa" polycoef="0 0.1 0 0 0"/></equality>""",
    "ball, then a hinge with a spring": f"""
        <worldbody>
          <body name="a" pos="0 0 1"><joint name="qa" type="ball"/>{ROD}
            <body name="b" pos=".3 0 0"><joint name="qb" axis="0 1 1" stiffness="2" damping=".05"/>{ROD}</body></body>
        </worldbody>""",
    "two arms on a free body": f"""
        <worldbody>
          <body name="base" pos="0 0 2"><freejoint name="float"/><geom type="box" size=".1 .2 .05" density="500"/>
            <body name="a" pos=".1 0 0"><joint name="qa" axis="0 1 0" stiffness="3" springref="20"/>{ROD}</body>
            <body name="b" pos="-.1 0 0"><joint name="qb" axis="1 0 0" stiffness="2" springref="-30"/>{ROD}</body></body>
        </worldbody>""",
    "a loop that is closed by a point": f"""
        <worldbody>
          <body name="a"><joint name="qa" axis="0 1 0"/>{ROD}
            <body name="b" pos=".3 0 .05"><joint name="qb" axis="0 1 0"/>{ROD}
              <body name="c" pos=".3 0 .05"><joint name="qc" axis="0 1 0"/>
                <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3" density="2700"/></body></body></body>
        </worldbody>
        <equality><connect body1="c" anchor="0 0 -.3"/></equality>""",
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", MODELS)
def test_model_moves_as_in_mujoco(name, tmp_path):
    from .peers import motion_of_mujoco, ours

    path = tmp_path / "model.xml"
    path.write_text(f'<mujoco model="m"><compiler autolimits="true"/>{MODELS[name]}</mujoco>', encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
        bodies, found = ours(uqmbd.from_mjcf(path), [0.0, 0.1, 0.2])
        expected = motion_of_mujoco(path, [0.0, 0.1, 0.2], bodies)
    known = np.isfinite(expected).all(axis=(0, 2))
    moved = np.abs(expected - expected[0])[:, known].max()
    assert np.abs(found - expected)[:, known].max() < 1e-7 + 1e-6 * moved
    assert known.all() and moved > 1e-3

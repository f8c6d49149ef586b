"""Libraries of the extra `geometry`."""

import pytest


@pytest.fixture
def trimesh():
    return pytest.importorskip("trimesh", reason="trimesh is not installed: meshes are not verified")


@pytest.fixture
def fcl():
    return pytest.importorskip("fcl", reason="python-fcl is not installed: clearances are not verified")

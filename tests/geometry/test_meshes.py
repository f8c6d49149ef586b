"""Mass, centre of mass and inertia of meshes against closed forms and MuJoCo; damaged and open meshes are refused."""

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_geometry import from_mesh, read_mesh

from .solids import box, cylinder, torus, write_obj, write_stl

pytestmark = pytest.mark.usefixtures("trimesh")


def numbers(found):
    return float(found["mass"]), np.array(found["com"], dtype=float), np.array(found["inertia"], dtype=float)


def test_box_is_exact_to_rounding(tmp_path):
    file = write_obj(tmp_path / "box.obj", *box((1, 2, 3), centre=(4, 5, 6)))
    mass, com, inertia = numbers(from_mesh(file, density=10.0))
    assert mass == pytest.approx(60, rel=1e-13)
    assert com == pytest.approx([4, 5, 6], rel=1e-13)
    assert inertia[:3] == pytest.approx([5 * (4 + 9), 5 * (1 + 9), 5 * (1 + 4)], rel=1e-11)
    assert np.abs(inertia[3:]).max() < 1e-10


def torus_closed(large, small, density):
    mass = density * 2 * np.pi**2 * large * small**2
    axial = mass * (large**2 + 0.75 * small**2)
    across = mass * (0.5 * large**2 + 0.625 * small**2)
    return mass, np.array([across, across, axial])


def cylinder_closed(radius, length, density):
    mass = density * np.pi * radius**2 * length
    across = mass * (3 * radius**2 + length**2) / 12
    return mass, np.array([across, across, mass * radius**2 / 2])


@pytest.mark.parametrize(
    ("make", "closed"),
    [
        (lambda n: torus(1.0, 0.3, n), torus_closed(1.0, 0.3, 5.0)),
        (lambda n: cylinder(0.4, 1.5, n), cylinder_closed(0.4, 1.5, 5.0)),
    ],
    ids=["torus", "cylinder"],
)
def test_curved_solids_converge_with_second_order(tmp_path, make, closed):
    errors = []
    for count in (16, 32, 64):
        file = write_obj(tmp_path / f"{count}.obj", *make(count))
        mass, com, inertia = numbers(from_mesh(file, density=5.0))
        errors.append([abs(mass / closed[0] - 1), *abs(inertia[:3] / closed[1] - 1)])
        assert np.abs(com).max() < 1e-12
    orders = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert orders == pytest.approx(np.full(orders.shape, 2.0), abs=0.05)


def rod(k):
    """A solid without symmetry: a tapered, turned and moved bar."""
    rng = np.random.default_rng(k)
    vertices, faces = box((0.3, 0.2, 1.0))
    vertices = vertices * (1 + 0.3 * vertices[:, 2:])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return vertices @ turn.T + rng.normal(size=3), faces


@pytest.mark.parametrize("k", range(10))
def test_ten_meshes_have_the_mass_and_inertia_of_mujoco(tmp_path, k):
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: meshes are not compared with MuJoCo")
    vertices, faces = rod(k) if k < 6 else torus(1.0, 0.2 + 0.05 * k, 8 + k) if k < 8 else cylinder(0.3, 1.0, 5 + k)
    file = write_stl(tmp_path / "part.stl", vertices, faces)
    text = (
        f'<mujoco><asset><mesh name="part" file="{file}" inertia="exact"/></asset><worldbody><body name="b">'
        '<freejoint/><geom type="mesh" mesh="part" density="1234"/></body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    mass, com, inertia = numbers(from_mesh(file, density=1234.0))
    assert mass == pytest.approx(model.body_mass[1], rel=1e-5)
    assert com == pytest.approx(model.body_ipos[1], abs=1e-5)
    xx, yy, zz, xy, xz, yz = inertia
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert moments == pytest.approx(np.sort(model.body_inertia[1]), rel=1e-4)


def test_density_and_scale_may_be_random(tmp_path):
    density = uqmbd.RandomVariable("density", chaospy.Normal(7850, 50), units="kg/m^3")
    scale = uqmbd.RandomVariable("shrinkage", chaospy.Uniform(0.00098, 0.001))
    file = write_obj(tmp_path / "box.obj", *box((100, 200, 300)))
    found = from_mesh(file, density, scale)
    mechanism = uqmbd.Mechanism("m", uqmbd.Spatial())
    body = mechanism.body("b", **found)
    assert mechanism.inputs.names == ("density", "shrinkage")
    at = {density: 8000.0, scale: 0.001}
    assert float(sympy.sympify(body.mass).xreplace(at)) == pytest.approx(8000 * 0.006)
    assert float(body.inertia[0].xreplace(at)) == pytest.approx(48 / 12 * (0.04 + 0.09))
    plane = from_mesh(file, 8000.0, 0.001, planar=True)
    flat = uqmbd.Mechanism("flat", uqmbd.Planar()).body("b", **plane)
    assert float(flat.inertia) == pytest.approx(48 / 12 * (0.01 + 0.04))


def open_box(tmp_path):
    vertices, faces = box((1, 1, 1))
    return write_obj(tmp_path / "open.obj", vertices, faces[1:])


def inverted_box(tmp_path):
    vertices, faces = box((1, 1, 1))
    return write_obj(tmp_path / "inverted.obj", vertices, faces[:, ::-1])


def twisted_box(tmp_path):
    vertices, faces = box((1, 1, 1))
    faces[3] = faces[3][::-1]
    return write_obj(tmp_path / "twisted.obj", vertices, faces)


def flat_sheet(tmp_path):
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    return write_obj(tmp_path / "flat.obj", vertices, [[0, 1, 2], [0, 2, 1]])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (open_box, "surface is open: 3 edges.*fill_holes"),
        (inverted_box, "inverted: its volume is -1.*Turn all triangles"),
        (twisted_box, "some triangles are inverted.*fix_winding"),
        (flat_sheet, "zero within rounding|surface is open"),
    ],
)
def test_surfaces_that_enclose_no_solid_are_refused_with_the_remedy(tmp_path, make, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        from_mesh(make(tmp_path), density=1000.0)


def test_missing_files_and_unknown_formats(tmp_path):
    with pytest.raises(uqmbd.StudyError, match="cannot be read: No such file"):
        read_mesh(tmp_path / "none.stl")
    (tmp_path / "part.step").write_text("x")
    with pytest.raises(uqmbd.StudyError, match="format of .*unknown; expected one of .stl, .obj"):
        read_mesh(tmp_path / "part.step")
    with pytest.raises(uqmbd.StudyError, match="density is -1.0"):
        from_mesh(tmp_path / "none.stl", density=-1.0)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "glb", "off"])
def test_damaged_files_give_a_mesh_or_one_message(tmp_path, trimesh, kind):
    """Readers meet random bytes, cuts and changes: no other exception leaves `read_mesh`."""
    vertices, faces = box((1, 2, 3))
    content = trimesh.Trimesh(vertices, faces, process=False).export(file_type=kind)
    content = content.encode() if isinstance(content, str) else bytes(content)
    rng = np.random.default_rng(7)
    read = refused = 0
    for k in range(60):
        damaged = bytearray(content)
        if k % 3 == 0:
            damaged = damaged[: rng.integers(0, len(damaged))]
        elif k % 3 == 1:
            for place in rng.integers(0, len(damaged), 1 + k // 6):
                damaged[place] = rng.integers(0, 256)
        else:
            damaged = bytearray(rng.integers(0, 256, 200, dtype=np.uint8).tobytes())
        file = tmp_path / f"damaged{k}.{kind}"
        file.write_bytes(bytes(damaged))
        try:
            assert np.isfinite(read_mesh(file).vertices).all()
            read += 1
        except uqmbd.StudyError as error:
            assert f"damaged{k}" in str(error)
            refused += 1
    assert refused > 10 and read + refused == 60


def test_a_mesh_file_refers_to_no_other_file(tmp_path):
    """The buffer of a glTF file and the materials of an OBJ file are other files, which are not opened."""
    secret = tmp_path / "secret.bin"
    secret.write_bytes(np.zeros((3, 3), dtype="<f4").tobytes())
    text = (
        '{"asset": {"version": "2.0"}, "buffers": [{"uri": "secret.bin", "byteLength": 36}], "bufferViews": [{"buffer":'
        ' 0, "byteLength": 36}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],'
        ' "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes":'
        ' [0]}], "scene": 0}'
    )
    file = tmp_path / "outside.gltf"
    file.write_text(text)
    with pytest.raises(uqmbd.StudyError, match="not a readable GLTF mesh"):
        read_mesh(file)
    material = write_obj(tmp_path / "box.obj", *box((1, 1, 1)))
    material.write_text("mtllib ../../secret.mtl\nusemtl a\n" + material.read_text())
    assert len(read_mesh(material).faces) == 12

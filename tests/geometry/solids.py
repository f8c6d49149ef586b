"""Surfaces of solids with known volume, centre and inertia."""

import numpy as np


def box(size, centre=(0, 0, 0)):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))])
    return corners + centre, faces


def grid(rows, columns, place):
    """Triangles of a closed grid of rows and columns."""
    r, c = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    vertices = place(2 * np.pi * r.ravel() / rows, 2 * np.pi * c.ravel() / columns)
    a, b = r * columns + c, (r + 1) % rows * columns + c
    d, e = r * columns + (c + 1) % columns, (r + 1) % rows * columns + (c + 1) % columns
    one = np.stack([a.ravel(), b.ravel(), e.ravel()], axis=1)
    two = np.stack([a.ravel(), e.ravel(), d.ravel()], axis=1)
    return vertices, np.concatenate([one, two])


def torus(large, small, count):
    def place(u, v):
        out = large + small * np.cos(v)
        return np.column_stack([out * np.cos(u), out * np.sin(u), small * np.sin(v)])

    return grid(2 * count, count, place)


def cylinder(radius, length, count):
    turn = 2 * np.pi * np.arange(count) / count
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    low, high = (np.column_stack([ring, np.full(count, z)]) for z in (-length / 2, length / 2))
    vertices = np.concatenate([low, high, [[0, 0, -length / 2], [0, 0, length / 2]]])
    k, n = np.arange(count), (np.arange(count) + 1) % count
    sides = [np.column_stack([k, n, n + count]), np.column_stack([k, n + count, k + count])]
    ends = [np.column_stack([np.full(count, 2 * count), n, k])]
    ends.append(np.column_stack([np.full(count, 2 * count + 1), k + count, n + count]))
    return vertices, np.concatenate([*sides, *ends])


def write_stl(path, vertices, faces):
    """Write a binary STL file."""
    corners = np.asarray(vertices)[np.asarray(faces)].astype("<f4")
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    record["corners"] = corners
    path.write_bytes(b"\0" * 80 + np.uint32(len(faces)).tobytes() + record.tobytes())
    return path


def write_obj(path, vertices, faces):
    """Write an OBJ file, with all digits."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.asarray(faces).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path

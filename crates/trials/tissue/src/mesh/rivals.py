"""Fills a closed surface with tetrahedra: METHOD SURFACE.obj TARGET_TETS OUT; prints the seconds that the mesher alone took."""

import os
import sys
import threading
import time

import numpy as np

LIMIT_S = 900


def surface(path):
    lines = [line.split() for line in open(path) if line[:2] in ("v ", "f ")]
    points = np.array([[float(x) for x in words[1:4]] for words in lines if words[0] == "v"])
    faces = np.array([[int(n.split("/")[0]) - 1 for n in words[1:4]] for words in lines if words[0] == "f"], np.int32)
    return points, faces


def volume(points, faces):
    a, b, c = (points[faces[:, n]] - points.mean(axis=0) for n in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0


def by_tetgen(points, faces, target):
    import tetgen

    # A mean element has about 0.55 of the largest allowed volume.
    most = volume(points, faces) / target / 0.55
    mesher = tetgen.TetGen(points, faces)
    found = mesher.tetrahedralize(switches=f"pq1.2/18a{most:.6f}Q")
    return found[0], found[1]


def by_ftetwild(points, faces, target):
    import pytetwild

    # A regular tetrahedron of edge l has the volume l^3 / 8.49.
    edge = (8.49 * volume(points, faces) / target) ** (1 / 3)
    return pytetwild.tetrahedralize(points, faces, edge_length_abs=edge, quiet=True)


def write_tetgen(out, points, tets):
    with open(out + ".node", "w") as file:
        file.write(f"{len(points)} 3 0 0\n")
        file.writelines(f"{n} {p[0]:.9g} {p[1]:.9g} {p[2]:.9g}\n" for n, p in enumerate(points))
    with open(out + ".ele", "w") as file:
        file.write(f"{len(tets)} 4 0\n")
        file.writelines(f"{n} {t[0]} {t[1]} {t[2]} {t[3]}\n" for n, t in enumerate(tets))


def write_gmsh(out, points, tets):
    with open(out + ".msh", "w") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n")
        file.writelines(f"{n} {p[0]:.9g} {p[1]:.9g} {p[2]:.9g}\n" for n, p in enumerate(points, 1))
        file.write(f"$EndNodes\n$Elements\n{len(tets)}\n")
        corners = tets + 1
        file.writelines(f"{n} 4 2 1 1 {t[0]} {t[1]} {t[2]} {t[3]}\n" for n, t in enumerate(corners, 1))
        file.write("$EndElements\n")


def oriented(points, tets):
    """Positive volumes, as both formats want them, whatever the mesher's order."""
    a, b, c, d = (points[tets[:, n]] for n in range(4))
    flipped = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    tets[flipped] = tets[flipped][:, [0, 1, 3, 2]]
    return tets


def give_up():
    print(f"no mesh after {LIMIT_S} s", file=sys.stderr, flush=True)
    os._exit(3)


def main():
    clock = threading.Timer(LIMIT_S, give_up)
    clock.daemon = True
    clock.start()
    method, path, target, out = sys.argv[1:5]
    points, faces = surface(path)
    start = time.perf_counter()
    mesher = {"TetGen": by_tetgen, "fTetWild": by_ftetwild}[method]
    nodes, tets = mesher(points, faces, int(target))
    seconds = time.perf_counter() - start
    write = {"TetGen": write_tetgen, "fTetWild": write_gmsh}[method]
    write(out, nodes, oriented(np.asarray(nodes), np.array(tets, np.int64)))
    print(f"seconds {seconds:.3f}")


main()

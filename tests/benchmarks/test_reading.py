"""Reading of meshes, against trimesh and meshio.

    pytest tests/benchmarks/test_reading.py --benchmark-enable -s

prints, for files of a full body in every format, the shortest time of each library. None of these
keeps vertices in order in all formats; OBJ files come with texture coordinates as well.
"""

import time

import pytest
import trimesh

import riemhuman as rh

meshio = pytest.importorskip("meshio")

N_REPEATS = 30


def shortest(read):
    """Return the least milliseconds of many calls."""
    seconds = []
    for _ in range(N_REPEATS):
        start = time.perf_counter()
        read()
        seconds.append(time.perf_counter() - start)
    return 1e3 * min(seconds)


def textured(path):
    """Give every vertex of an OBJ file a texture coordinate and a normal."""
    lines = path.read_text().splitlines()
    extra = ["vt 0 0\nvn 0 0 1" for line in lines if line[0] == "v"]
    corners = [
        line if line[0] == "v" else " ".join(["f", *(f"{k}/{k}/{k}" for k in line.split()[1:])])
        for line in lines
    ]
    path.write_text("\n".join([*corners[: len(extra)], *extra, *corners[len(extra) :]]) + "\n")


@pytest.mark.parametrize("name", ["a.ply", "a.obj", "textured.obj", "a.off", "a.glb"])
def test_reading(benchmark, tmp_path, name):
    bodies = rh.datasets.load_open_bodies("full")
    file = tmp_path / name
    rh.save_mesh(file, bodies[0], bodies.template.faces)
    if name == "textured.obj":
        textured(file)
    others = {"trimesh": lambda: trimesh.load(file, process=False)}
    if name != "a.glb":
        others["meshio"] = lambda: meshio.read(file)
    benchmark.pedantic(rh.load_mesh, (file,), rounds=1)
    ours = shortest(lambda: rh.load_mesh(file))
    theirs = {library: shortest(read) for library, read in others.items()}
    listed = ", ".join(f"{library} {ms:.1f}" for library, ms in theirs.items())
    print(f"\n{name}: {ours:.1f} ms; {listed}")
    assert ours < 3.0 * min(theirs.values())

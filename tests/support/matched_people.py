"""Stand-ins for SHREC'19: open bodies of different connectivity, in the files of its layout."""

import numpy as np
from scipy.io import savemat
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.registration.simulated_scans import remesh


def write_stand_ins(folder, bodies, numbers, n_vertices, rng):
    """Write remeshed bodies, the places of their vertices, and matches of all ordered pairs."""
    for name in ("mat", "matches/FARMgt_txt"):
        (folder / name).mkdir(parents=True)
    places = {}
    for name, (number, count) in enumerate(zip(numbers, n_vertices, strict=True), 1):
        rotation = Rotation.from_euler("y", rng.uniform(0.0, 360.0), degrees=True).as_matrix()
        vertices, faces = remesh(bodies[number], bodies.template.faces, count, rng)
        places[name] = cKDTree(vertices).query(bodies[number])[1]
        owners = cKDTree(bodies[number]).query(vertices)[1]
        shape = {"VERT": vertices @ rotation.T, "TRIV": faces + 1.0}
        shape["smpl_matches"] = places[name] + 1
        savemat(folder / f"mat/{name}.mat", {"Shape_df": shape, "graph": np.eye(3)})
        places[name] = places[name], owners
    pairs = [(a, b) for a in places for b in places if a != b]
    for a, b in pairs:
        matches = places[b][0][places[a][1]] + 1
        np.savetxt(folder / f"matches/FARMgt_txt/{a}_{b}.txt", matches, fmt="%d")
    text = "".join(f"{a},{b}\n" for a, b in pairs)
    (folder / "PAIRS_list_SHREC19_connectivity.txt").write_text(text, encoding="utf-8")
    return pairs

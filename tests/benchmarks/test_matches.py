"""Matching scans of different connectivity without landmarks: SHREC'19, or stand-ins for it.

    RIEMHUMAN_SHREC19=~/SHREC19 pytest tests/benchmarks/test_matches.py --benchmark-enable -s

prints how many meshes are trusted, and the mean geodesic error × 100 over √area of the pairs of the
list whose meshes are; without the folder, of remeshed open bodies in files of the same layout.
"""

import os

import numpy as np
from matched_people import write_stand_ins

import riemhuman as rh
from riemhuman.registration import ScanRegistration, correspondence, geodesic_errors

STAND_INS, N_VERTICES = (2, 17, 41, 58), (5000, 9000, 7000, 12_000)


def chosen_meshes(folder):
    """Return a name and the meshes of SHREC'19, or of stand-ins that are written to a folder."""
    if "RIEMHUMAN_SHREC19" in os.environ:
        return "SHREC'19", rh.datasets.load_shrec19(os.environ["RIEMHUMAN_SHREC19"])
    bodies = rh.datasets.load_open_bodies("coarse", variant="natural", people=909)
    write_stand_ins(folder / "data", bodies, STAND_INS, N_VERTICES, np.random.default_rng(3))
    return "simulated people", rh.datasets.load_shrec19(folder)


def test_matches_of_different_connectivity(benchmark, tmp_path):
    name, meshes = chosen_meshes(tmp_path)
    registration = ScanRegistration()

    def register():
        return [registration.solve((mesh.vertices, mesh.faces)) for mesh in meshes]

    results = benchmark.pedantic(register, rounds=1)
    loaded = [meshes[k] for k in range(len(meshes))]
    print(f"\n{name}: {sum(result.trusted for result in results)} of {len(meshes)} meshes trusted")
    means, placed = [], []
    for a, b in meshes.pairs:
        if not (results[a].trusted_vertices.any() and results[b].trusted_vertices.any()):
            continue
        found = correspondence(results[a], results[b]).vertices[loaded[a].places]
        errors = geodesic_errors(loaded[b].vertices, loaded[b].faces, found, loaded[b].places)
        means.append(100.0 * np.nanmean(errors))
        placed.append(np.mean(found >= 0))
    print("| pairs | mean geodesic error × 100 / √area | median pair | worst pair | places found |")
    print("|---|---|---|---|---|")
    print(
        f"| {len(means)} of {len(meshes.pairs)} | {np.mean(means):.2f} | {np.median(means):.2f} "
        f"| {np.max(means):.2f} | {100 * np.mean(placed):.1f} % |"
    )
    assert len(means) > 0.5 * len(meshes.pairs)
    assert np.median(means) < 5.0

"""Draw the picture at the top of README.md: `python tutorials/front_picture.py`.

From arms up to bent elbows: the straight path above, the geodesic below, coloured by how far the
areas of triangles leave the range of those at the end points.
"""

from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

import riemhuman as rh

matplotlib.use("agg")


def main() -> None:
    """Compute the paths at full resolution and write front_picture.png beside this file."""
    bodies = rh.datasets.load_open_bodies()
    motions = rh.datasets.load_open_motions(sequences=["chicken_wings", "shake_arms", "punching"])
    basis = rh.DeformationBasis.from_motions(motions, n_components=100)
    metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), a=1.0, lam=1.0, c=0.0)
    start, end = (
        bodies.points[20 + bodies.pose_names.index(p)] for p in ("arms_up", "bent_elbows")
    )
    paths = {
        "straight": rh.solvers.LinearPath(7).solve(metric, start, end),
        "geodesic": rh.solvers.BasisPath(basis, n_nodes=7).solve(metric, start, end),
    }
    figure, axes = plt.subplots(2, 1, figsize=(13, 6.8), layout="constrained")
    for ax, (name, result) in zip(axes, paths.items(), strict=True):
        change = area_change(result.path, bodies.template.faces)
        rh.report.plot_path(
            result.path, bodies.template.faces, change, largest=0.5, ax=ax, spacing=1.3
        )
        ax.set_title(
            f"{name}: energy {result.energy:.2f}; 99 % of triangles change their areas by at most "
            f"{np.quantile(change, 0.99):.0%} beyond the end points"
        )
    target = Path(__file__).with_suffix(".png")
    figure.savefig(target, dpi=100)
    print(target)


def area_change(path: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return by what share triangles leave the range of areas at the ends, shape (n_nodes, F)."""
    corners = path[:, faces]
    sides = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    areas = np.linalg.norm(sides, axis=-1) / 2
    smallest, largest = areas[[0, -1]].min(axis=0), areas[[0, -1]].max(axis=0)
    return np.maximum(np.maximum(areas / largest - 1, 1 - areas / smallest), 0.0)


if __name__ == "__main__":
    main()

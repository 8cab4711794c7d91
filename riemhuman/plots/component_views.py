"""A page with a slider for each principal component of bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Points, Triangles
from riemhuman.checks import checked, instance
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.plots.viewed_bodies import ComponentChanges, ViewedBody
from riemhuman.plots.viewer import Viewer
from riemhuman.solvers import TangentPCA

_MOST_COMPONENTS = 10
_DEVIATIONS = 2.0  # from the mean, where bodies of one component are exact


@checked(pca=instance(TangentPCA, "a TangentPCA(...)"))
def view_components(
    pca: TangentPCA, faces: ArrayLike | None = None, *, title: str = "Principal components"
) -> Viewer:
    r"""Return a page with a slider for each of the first ten components, and random bodies.

    Sliders go from −3 to 3 standard deviations. The page computes the body
    :math:`\bar x + \sum_k c_k a_k + c_k^2 b_k`, where :math:`a_k` and :math:`b_k` make the bodies
    at −2 and 2 standard deviations of each component exact (`TangentPCA.inverse_transform`). The
    page says how far that is from the exact body if all components are 1.

    Parameters
    ----------
    pca : TangentPCA
        Fitted to surfaces.
    faces : array_like, shape (F, 3), optional
        Triangles; by default those of the space's template.
    title : str

    Raises
    ------
    ArgumentError
        If `pca` is not fitted, or not to surfaces.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template, equip=False)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
    >>> pca = rh.TangentPCA(space, n_components=2).fit(bodies.points[:50:10])
    >>> rh.plots.view_components(pca).save("components.html")
    """
    (middle,) = pca.inverse_transform(np.zeros((1, 1)))
    if middle.ndim != 2 or middle.shape[1] != 3:
        raise ArgumentError(f"pca must be fitted to surfaces; found points of {middle.shape}")
    triangles = _triangles(pca, middle, faces)
    count = min(_MOST_COMPONENTS, pca.n_components_)
    deviations = np.sqrt(pca.explained_variance_[:count])
    ends = np.diag(_DEVIATIONS * deviations)
    upper = pca.inverse_transform(ends)
    lower = pca.inverse_transform(-ends)
    (exact,) = pca.inverse_transform(deviations[np.newaxis])
    changes = ComponentChanges(
        linear=(upper - lower) / (2 * _DEVIATIONS),
        quadratic=((upper + lower) / 2 - middle) / _DEVIATIONS**2,
        shares=pca.explained_variance_ratio_[:count],
    )
    gap = np.linalg.norm(changes.mixed(middle, np.ones(count)) - exact, axis=-1).max()
    description = (
        f"Bodies are exact at −{_DEVIATIONS:g}, 0 and {_DEVIATIONS:g} standard deviations of one "
        f"component; if all components are at 1, they are accurate to {1000 * gap:.1f} mm."
    )
    body = ViewedBody("", middle[np.newaxis], components=changes)
    return Viewer(triangles, {"Components": [body]}, title=title, description=description)


def _triangles(pca: TangentPCA, middle: Points, faces: ArrayLike | None) -> Triangles:
    if faces is not None:
        return check_mesh(middle, faces)[1]
    if not isinstance(pca.space, AlignedSurfaces):
        raise ArgumentError(
            f"faces must be given for points of {type(pca.space).__name__}, which has no template"
        )
    return pca.space.template.faces

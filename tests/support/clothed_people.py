"""People in simulated clothes: scans of garments that hang over bodies which are known.

Garments are solids on a grid of voxels. Cloth lies on the skin where that faces up, stands off by
a smooth random distance elsewhere, spans the hollows of the trunk, and falls from what it lies on:
straight down, or drawn in or flared by a slope. A skirt spans the legs. Hems are steps. Shoes and
hair are not simulated.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_fill_holes, distance_transform_edt
from scipy.spatial import ConvexHull, cKDTree

from riemhuman.bodies.skinning import usual_joint_names
from riemhuman.datasets.open_bodies import surface_noise
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration.simulated_scans import SimulatedScan
from riemhuman.surfaces.measures import triangle_areas

_VOXEL = 0.01
# No cloth is farther from the skin than this, metres.
_REACH = 0.3
_POINTS_PER_SQUARE_METRE = 7000
_FABRIC = 0.002
# Where skin faces straight up, cloth keeps this share of its distance.
_RESTING = 0.2
_BAGGY_WAVES, _WRINKLES = (0.25, 0.5), (0.05, 0.12)
_TRUNK = ("pelvis", "lower_spine", "middle_spine", "upper_spine", "chest", "collar", "neck")


@dataclass(frozen=True)
class Garment:
    """A garment: what it covers, and how it hangs.

    Lengths of sleeves and legs count bones: 0.5 ends in the middle of the upper arm or thigh, 2 at
    the wrist or ankle; 0 is none. Distances are metres.
    """

    sleeves: float
    legs: float
    distance: float  # of the cloth from the skin, in the mean where it does not lie on it
    trunk: bool = True  # whether it covers the trunk, or only what is below the waist
    gathered: float = 0.15  # the cloth falls inward by this slope; negative if it flares
    is_skirt: bool = False


_TROUSERS = Garment(0, 1.9, 0.011, trunk=False, gathered=0.12)
OUTFITS = {
    "T-shirt and trousers": (Garment(0.6, 0.15, 0.012), _TROUSERS),
    "jumper and jeans": (
        Garment(1.9, 0.1, 0.018, gathered=0.25),
        Garment(0, 1.9, 0.005, trunk=False, gathered=0.3),
    ),
    "shirt and trousers": (Garment(1.9, 0.2, 0.014, gathered=0.05), _TROUSERS),
    "hoodie and wide trousers": (
        Garment(1.9, 0.2, 0.028, gathered=0.05),
        Garment(0, 1.9, 0.018, trunk=False, gathered=0.0),
    ),
    "dress to the knee": (Garment(0.4, 1.0, 0.01, gathered=-0.12, is_skirt=True),),
}


def clothed_scan(model, body, outfit, rng):
    """Return the scan of a body in an outfit: loose points, 2 mm of noise, y up.

    Parameters
    ----------
    model : BodyModel
    body : array, shape (V, 3)
        A surface in the model's triangulation, y up, metres.
    outfit : iterable of Garment
    rng : numpy.random.Generator
    """
    skin = _Skin(model, body, rng)
    voxels = _Voxels(skin)
    cloth = np.full(voxels.shape, _REACH)
    for garment in outfit:
        cloth = np.minimum(cloth, _hung(skin, garment, voxels, rng))
    points = _zero_crossings(cloth) * _VOXEL + voxels.low
    # Underneath a hem, the solid ends within the body.
    points = points[skin.heights_of(points)[0] > 0.5 * _FABRIC]
    # An edge of the grid crosses a slanting surface more often than a level one.
    points = points[rng.random(len(points)) < _POINTS_PER_SQUARE_METRE * _VOXEL**2 / 1.5]
    bare = skin.points[skin.is_bare & (cloth[voxels.numbers(skin.points)] > 0.0)]
    keep = rng.random(len(bare)) < _POINTS_PER_SQUARE_METRE * skin.area / len(skin.points)
    scan = np.concatenate([points, bare[keep]])
    return SimulatedScan(scan + 0.002 * rng.standard_normal(scan.shape), None, body)


class _Skin:
    """Dense points of a body, with normals, coordinates along limbs and places at rest."""

    def __init__(self, model, body, rng, n_points=60_000):
        faces, names = model.faces, usual_joint_names(model)
        areas = triangle_areas(body, faces)
        self.area = areas.sum()
        chosen = rng.choice(len(faces), n_points, p=areas / self.area)
        shares = rng.dirichlet(np.ones(3), n_points)

        def at(values):
            return np.einsum("nk,nk...->n...", shares, values[faces[chosen]])

        self.points, self.normals = at(body), at(vertex_normals(body, faces))
        self.tree = cKDTree(self.points)
        self.rest = at(model.template.vertices)
        owners = model.weights.argmax(axis=1)[faces[chosen, shares.argmax(axis=1)]]
        self.along = {
            limb: self._along(model, names, owners, joints)
            for limb, joints in {
                "arm": ("shoulder", "elbow", "wrist"),
                "leg": ("hip", "knee", "ankle"),
            }.items()
        }
        trunk = [k for k, name in enumerate(names) if name.endswith(_TRUNK)]
        collar = self.rest[:, 1] < model.joints()[names.index("neck"), 1] + 0.03
        self.on_trunk = np.isin(owners, trunk) & collar
        self.below_waist = self.rest[:, 1] < model.joints()[names.index("lower_spine"), 1] + 0.05
        self.is_bare = np.ones(n_points, bool)
        sideways = at(vertex_normals(model.template.vertices, faces))[:, 0]
        self.faces_other_leg = np.isfinite(self.along["leg"]) & (sideways * self.rest[:, 0] < 0.0)

    def _along(self, model, names, owners, joints):
        """Return coordinates along limbs: 0 to 1 on the first bone, 1 to 2 on the second."""
        places, positions = np.full(len(owners), np.nan), model.joints()
        for side in ("left", "right"):
            numbers = [names.index(f"{side}_{joint}") for joint in joints]
            for bone in range(2):
                on_bone = owners == numbers[bone]
                start, end = positions[numbers[bone : bone + 2]]
                share = (self.rest[on_bone] - start) @ (end - start) / np.sum((end - start) ** 2)
                places[on_bone] = bone + np.clip(share, 0.0, 1.0)
        return places

    def heights_of(self, points):
        """Return heights of points above the skin, and the nearest points on it."""
        distances, nearest = self.tree.query(points)
        gaps = points - self.points[nearest]
        inside = np.einsum("nx,nx->n", gaps, self.normals[nearest]) < 0.0
        return np.where(inside, -distances, distances), nearest

    def covered_by(self, garment):
        """Return which points a garment covers."""
        trunk = self.on_trunk & (garment.trunk | self.below_waist)
        arms = self.along["arm"] < garment.sleeves
        return trunk | arms | (self.along["leg"] < garment.legs)


class _Voxels:
    """A grid of voxels around a body, with their heights above the skin next to them."""

    def __init__(self, skin):
        self.low = skin.points.min(axis=0) - 0.2
        self.shape = np.ceil((skin.points.max(axis=0) + 0.2 - self.low) / _VOXEL).astype(int)
        numbers = self.numbers(skin.points)
        owners = np.full(self.shape, -1)
        owners[numbers] = np.arange(len(skin.points))
        distances, places = distance_transform_edt(owners < 0, _VOXEL, return_indices=True)
        self.nearest = owners[tuple(places)]
        # Near the skin, voxels are too wide to say how far it is.
        near = np.argwhere(distances < 0.05)
        centres = near * _VOXEL + self.low
        near = tuple(near.T)
        distances[near], self.nearest[near] = skin.heights_of(centres)
        # Deep inside the body, they are below their neighbours.
        deep = binary_fill_holes(distances < 0.0) & (distances > 0.0)
        self.heights = np.where(deep, -distances, distances)

    def numbers(self, points):
        """Return the voxels in which points lie."""
        return tuple(np.rint((points - self.low) / _VOXEL).astype(int).T)


def _hung(skin, garment, voxels, rng):
    """Return heights of voxels above the cloth of one garment, negative inside it."""
    covered = skin.covered_by(garment)
    skin.is_bare &= ~covered
    baggy = _noise(skin.rest, _BAGGY_WAVES, rng)
    wrinkles = _noise(skin.rest, _WRINKLES, rng)
    loose = np.clip(garment.distance * (1.0 + 0.5 * baggy + 0.25 * wrinkles), 0.0, None)
    up = np.clip(skin.normals[:, 1], 0.0, 1.0)
    loose = (_FABRIC + loose * (1.0 - (1.0 - _RESTING) * up))[voxels.nearest]
    # Cloth falls far from the trunk and outside the legs; a sleeve soon comes back to the arm.
    steep = np.isfinite(skin.along["arm"]) | (skin.faces_other_leg & ~garment.is_skirt)
    slopes = np.where(steep, 1.5, garment.gathered)[voxels.nearest]
    legs = garment.is_skirt & (skin.along["leg"] < garment.legs)
    spanned = ((skin.on_trunk | legs) & covered)[voxels.nearest] & (voxels.heights < 0.0)
    covered = covered[voxels.nearest] & (voxels.heights < 0.02 + 4.0 * garment.distance)
    hem = np.flatnonzero(covered.any(axis=(0, 2))).min()
    level = np.where(covered, voxels.heights - loose, _REACH)
    for k in range(level.shape[1] - 2, -1, -1):
        hull = _height_over_hull(spanned[:, k])
        allowed = covered[:, k] | (garment.is_skirt & (hull < _REACH) & (k >= hem))
        level[:, k] = np.minimum(level[:, k], hull - loose[:, k])
        falling = level[:, k + 1] + slopes[:, k] * _VOXEL
        level[:, k] = np.where(allowed, np.minimum(level[:, k], falling), _REACH)
    return level


def _height_over_hull(inside):
    """Return horizontal distances of a slice's voxels from the convex hull of some of them."""
    places = np.argwhere(inside)
    if len(places) < 12 or np.ptp(places, axis=0).min() < 2:
        return np.full(inside.shape, _REACH)
    planes = ConvexHull(places).equations
    grid = np.stack(np.indices(inside.shape), axis=-1)
    return _VOXEL * (grid @ planes[:, :2].T + planes[:, 2]).max(axis=-1)


def _noise(places, wavelengths, rng):
    """Return smooth random numbers with a standard deviation of about 1."""
    noise = surface_noise(places, 1.0, wavelengths, rng)[:, 0]
    return noise / noise.std()


def _zero_crossings(level):
    """Return where the edges of a grid cross the surface on which its values vanish."""
    crossings = []
    for axis in range(3):
        first = np.moveaxis(level, axis, 0)[:-1]
        second = np.moveaxis(level, axis, 0)[1:]
        places = np.argwhere((first < 0.0) != (second < 0.0))
        ends = first[tuple(places.T)], second[tuple(places.T)]
        shares = ends[0] / (ends[0] - ends[1])
        order = np.insert(np.array([1, 2]), axis, 0)  # of x, y and z among moved axes
        crossing = places.astype(float)
        crossing[:, 0] += shares
        crossings.append(crossing[:, order])
    return np.concatenate(crossings)

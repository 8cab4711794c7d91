"""People who are in no data set, in moments of motions that are no start poses, and their scans."""

import numpy as np

import riemhuman as rh
from riemhuman.datasets.surface_noise import surface_noise

MOTIONS = (
    "chicken_wings",
    "hips",
    "jumping_jacks",
    "knees",
    "light_hopping_loose",
    "one_leg_jump",
    "one_leg_loose",
    "punching",
    "running_on_spot",
    "shake_arms",
)
N_PEOPLE = 10
_FRAMES = (37, 91)
_DETAIL_METRES, _WAVELENGTHS = 0.001, (0.1, 0.4)


def bodies_to_scan(model, seed):
    """Yield subject, moment and surface of a hundred bodies, ten people in ten moments.

    Every person has a shape of its own, a way of its own to move, and a surface that differs by a
    millimetre from what the model can show.
    """
    resolution = "full" if model.n_vertices > 5000 else "coarse"
    motions = rh.datasets.load_open_motions(resolution, sequences=list(MOTIONS))
    rng = np.random.default_rng([seed, 15])
    builds = np.clip(rng.standard_normal((N_PEOPLE, model.n_betas)), -2.0, 2.0)
    # So many adults are the model's first ten coefficients for.
    builds[:, 10:] = 0.0
    frames = rng.integers(*_FRAMES, len(MOTIONS))
    for subject in range(N_PEOPLE):
        own = motions[subject * len(MOTIONS) : (subject + 1) * len(MOTIONS)]
        for moment, (motion, frame) in enumerate(zip(own, frames, strict=True)):
            posture = motion.pose_vectors[frame], motion.translations[frame]
            detail = surface_noise(model.template.vertices, _DETAIL_METRES, _WAVELENGTHS, rng)
            yield subject, moment, model(builds[subject], *posture) + detail


def scans_of(bodies, faces, seed, numbers=None, **options):
    """Yield number, subject, moment and scan: remeshed, 2 mm noise, 10 % in holes, any heading."""
    chosen = {"n_points": 12_000, "mesh": True, "noise": 0.002, "missing": 0.1} | options
    for number, (subject, moment, surface) in enumerate(bodies):
        if numbers is None or number in numbers:
            rng = np.random.default_rng([seed, number])
            scan = rh.registration.simulated_scan(surface, faces, rng, **chosen)
            yield number, subject, moment, scan

"""Any number of bodies, made when they are asked for: random people in the open motions."""

from functools import cache

import numpy as np

from riemhuman.datasets import load_open_model, load_open_motions


@cache
def motions():
    """Return the open motions; poses do not depend on the resolution."""
    return load_open_motions("coarse", frames_per_second=30)


class PeopleInMotion:
    """People of random build, each in a stretch of a random motion.

    Frames that follow each other are near each other, so the set has neighbours. Body i does not
    depend on how many there are, nor on how they are sliced.

    Parameters
    ----------
    n_bodies : int
        Number of bodies.
    resolution : {"full", "coarse"}
        Resolution of the open model.
    n_frames : int
        Bodies of one person.
    seed : int
        Another seed makes other people.
    """

    def __init__(self, n_bodies, resolution="coarse", n_frames=50, seed=0):
        self.n_bodies, self.n_frames, self.seed = n_bodies, n_frames, seed
        self.model = load_open_model(resolution)

    def __len__(self):
        return self.n_bodies

    def __getitem__(self, part):
        numbers = range(self.n_bodies)[part]
        bodies = np.empty((len(numbers), self.model.n_vertices, 3))
        people = np.asarray(numbers) // self.n_frames
        for person in np.unique(people):
            here = people == person
            rng = np.random.default_rng([self.seed, person])
            betas = rng.standard_normal(self.model.n_betas)
            motion = motions()[rng.integers(len(motions()))]
            start = rng.integers(len(motion) - self.n_frames)
            frames = start + np.asarray(numbers)[here] % self.n_frames
            bodies[here] = self.model(
                betas, motion.pose_vectors[frames], motion.translations[frames]
            )
        return bodies

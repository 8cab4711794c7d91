"""Maps between topologies, on other people and poses than the body they are made from.

    pytest tests/benchmarks/test_topologies.py --benchmark-enable -s

prints distances from the true places of remeshed simulated people, whose hands are on another body
open, relaxed or curled, and the time that a body's parameters take in a sequence. With
RIEMHUMAN_FAUST=FOLDER it also prints how far the registrations of FAUST are from themselves after
they went to the open model and back, by the map of the first one.
"""

import os
import time

import numpy as np
import pytest
from scanned_people import points_at
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.registration import TopologyMap
from riemhuman.registration.simulated_scans import remesh

PERFORMANCES = (
    *(("punching", 47, "relaxed"), ("knees", 61, "curled"), ("one_leg_jump", 70, "relaxed")),
    *(("jumping_jacks", 30, "loose fist"), ("punching", 20, "fist")),
)


def people_of_two_topologies(n_vertices, seed):
    """Return bodies of the full model, the first in a rest pose, and the same ones remeshed."""
    full, rng = rh.datasets.load_open_model("full"), np.random.default_rng(seed)
    rest = np.zeros((full.n_joints, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest[full.joint_names.index(f"{side}_shoulder")] = [0.0, 0.0, 0.5 * sign]
    bodies = [full(np.zeros(full.n_betas), rest, hands=full.hand_pose("open"))]
    vertices, faces = remesh(bodies[0], full.faces, n_vertices, rng)
    places, _ = rh.surfaces.nearest_points(vertices, bodies[0], full.faces)
    for name, frame, hands in PERFORMANCES:
        motion = rh.datasets.load_open_motions("full", sequences=[name])[0]
        betas = np.zeros(full.n_betas)
        betas[:10] = rng.standard_normal(10)
        bodies.append(full(betas, motion.pose_vectors[frame], hands=full.hand_pose(hands)))
    others = np.stack([points_at(places, body, full.faces) for body in bodies])
    return np.stack(bodies), others, faces


def text_of(found, truth, is_hand):
    """Return the mean distance, and that of hands, millimetres."""
    errors = 1000.0 * np.linalg.norm(found - truth, axis=-1)
    return f"{errors.mean():.2f} | {errors[:, is_hand].mean():.2f}"


@pytest.mark.parametrize("n_vertices", [6890, 18_000])
def test_maps_of_simulated_people(benchmark, n_vertices):
    full = rh.datasets.load_open_model("full")
    bodies, others, faces = people_of_two_topologies(n_vertices, seed=7)
    wrists = [full.joint_names.index(f"{side}_wrist") for side in ("left", "right")]
    is_hand = np.isin(full.weights.argmax(axis=1), wrists)
    near = cKDTree(bodies[0]).query(others[0])[1]
    print(f"\n{others.shape[1]:,} vertices, other people: mean | hands, mm")
    print("| model | to the model | from it | there and back | back and there |")
    print("|---|---|---|---|---|")
    for resolution in ("full", "coarse"):
        model = rh.datasets.load_open_model(resolution)
        kept = cKDTree(full.template.vertices).query(model.template.vertices)[1]
        if resolution == "full":
            found = benchmark.pedantic(TopologyMap.fit, args=((others[0], faces), model), rounds=1)
        else:
            found = TopologyMap.fit((others[0], faces), model)
        true, their = bodies[1:, kept], others[1:]
        there, back = found.to_model(their), found.to_template(true)
        cells = (
            text_of(there, true, is_hand[kept]),
            text_of(back, their, is_hand[near]),
            text_of(found.to_template(there), their, is_hand[near]),
            text_of(found.to_model(back), true, is_hand[kept]),
        )
        print(f"| {resolution} | {' | '.join(cell.replace(' | ', ', ') for cell in cells)} |")
        assert np.linalg.norm(there - true, axis=-1).mean() < 0.003
        assert np.linalg.norm(back - their, axis=-1).mean() < 0.003
        assert np.linalg.norm(found.to_template(there) - their, axis=-1).mean() < 0.001


def test_parameters_of_a_sequence(benchmark):
    """Fits of the coarse model to one person's frames, each started from the one before."""
    model, rng = rh.datasets.load_open_model("coarse"), np.random.default_rng(0)
    motion = rh.datasets.load_open_motions("coarse", sequences=["jumping_jacks"])[0]
    betas, poses = rng.standard_normal(model.n_betas), motion.pose_vectors[20:60:2]

    def pose_all():
        return np.stack([model(betas, pose) for pose in poses])

    frames = pose_all() + 0.002 * rng.standard_normal((len(poses), model.n_vertices, 3))
    started = time.process_time()
    pose_all()
    posing = (time.process_time() - started) / len(poses)
    model.fit(frames[:2], betas_prior=1e-7, sequence=True)
    started = time.process_time()
    options = {"betas_prior": 1e-7, "sequence": True}
    fit = benchmark.pedantic(model.fit, args=(frames,), kwargs=options, rounds=1)
    fitting = (time.process_time() - started) / len(poses)
    print(
        f"\n{1000 * fitting:.1f} ms of processor time a frame, {fitting / posing:.0f} times a pose "
        f"of the model; {fit.n_iterations.mean():.1f} steps"
    )
    assert fit.converged.all()


@pytest.mark.skipif("RIEMHUMAN_FAUST" not in os.environ, reason="needs FAUST")
def test_faust_to_the_open_model_and_back(benchmark):
    bodies = rh.datasets.load_faust(os.environ["RIEMHUMAN_FAUST"], align=False)
    faces = bodies.template.faces
    found = benchmark.pedantic(TopologyMap.fit, args=((bodies[0], faces),), rounds=1)
    back = found.to_template(found.to_model(bodies.points))
    errors = 1000.0 * np.linalg.norm(back - bodies.points, axis=-1).mean(axis=1)
    print(f"\nFAUST there and back: mean {errors.mean():.2f} mm, worst body {errors.max():.2f} mm")
    assert errors.mean() < 2.0

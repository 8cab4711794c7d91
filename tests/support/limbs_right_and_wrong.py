"""Registered limbs that are right, and such as are deliberately wrong, with how far scans are."""

from dataclasses import dataclass, replace

import numpy as np
from people_who_touch import people_who_touch, scan_of_touching
from scanned_people import bodies_to_scan, foreign_bodies, points_at, task_of
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.bodies.skinning import usual_joint_names
from riemhuman.registration import simulated_scan
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import DENSE_SCALES
from riemhuman.registration._crossed_limbs import crossing_joints, exchanged_limbs
from riemhuman.registration._dense_fit import fit_closest
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._pipeline import register_scan
from riemhuman.registration._shown_parts import leave_out_lost_limbs
from riemhuman.registration._verdict import judge

# What scanners and people do to scans, and what may be missing from them.
SCANS = {
    "2 mm noise": {},
    "no noise": {"noise": 0.0},
    "5 mm noise": {"noise": 0.005},
    "1,500 points": {"n_points": 1500},
    "clothes, up to 1.5 cm": {"clothing": 0.015},
    "clothes, up to 3 cm": {"clothing": 0.03},
    "30 % in holes": {"missing": 0.3},
    "one view": {"view": (0.3, 0.1, 1.0)},
    "hand missing": {},
    "forearm missing": {},
    "arm missing": {},
    "shin missing": {},
    "forearm and shin missing": {},
}
# The first joints of what is missing.
_MISSING = {
    "hand missing": ("left_wrist",),
    "forearm missing": ("right_elbow",),
    "arm missing": ("left_shoulder",),
    "shin missing": ("right_knee",),
    "forearm and shin missing": ("left_elbow", "left_knee"),
}
_POSTURES = ("arms folded", "hands on belly", "hands on hips", "wrists crossed", "feet crossed")
_N_POINTS = 8000
_LEAST_DEGREES, _MOST_DEGREES = 20.0, 90.0
_TURNED = ("shoulder", "elbow", "hip", "knee")
_HELD = 1e6  # inverse variance of a joint that is held
# Parts of limbs that are carried by another whose excess distrusts them, too.
_CARRIED_BY = {"elbow": "shoulder", "knee": "hip"}
# Vertices that near to the scan are shown by it, and a part of which so many are.
_SHOWN_METRES, _LEAST_SHOWN = 0.05, 0.3
# Mean errors of right and wrong parts of limbs; few are between.
RIGHT_METRES, WRONG_METRES = 0.03, 0.05


@dataclass(frozen=True)
class LimbPart:
    """A part of a limb of a registered body."""

    kind: str  # of scan
    change: str  # what was done to the registered body, "" for nothing
    part: str  # name of its joint
    error: float  # mean of what the scan shows, metres
    # The factor by which the scan is farther from it than from the rest, or from the part that
    # carries it, if that is larger: with a limb, what it carries is distrusted.
    excess: float
    trusted: float  # share of its vertices
    accepted: bool  # whether the body is trusted


def scans_of_limbs(model, seed):
    """Yield kinds, points, true surfaces and their places on the model, None for its own."""
    natural = rh.datasets.load_open_bodies("coarse", variant="natural", people=seed)
    moving = [surface for *_, surface in bodies_to_scan(model, seed)]
    rng = np.random.default_rng([seed, 48])
    for number, (name, options) in enumerate(SCANS.items()):
        body = (natural, moving)[number % 2][int(rng.integers(100))]
        chosen = {"n_points": _N_POINTS, "rotate": False} | options
        scan = simulated_scan(body, model.faces, rng, **chosen)
        yield name, without(model, body, _MISSING.get(name, ()), scan.points), body, None
    for posture, surface in people_who_touch(model, seed, 1, _POSTURES):
        yield posture, scan_of_touching(model, surface, rng, n_points=_N_POINTS), surface, None
    foreign, triangles, places = foreign_bodies(model, seed, 2, 1)
    for number, body in enumerate(foreign.reshape(-1, *foreign.shape[2:])):
        scan = simulated_scan(body, triangles, number, n_points=_N_POINTS, rotate=False)
        yield "another mesh", scan.points, body, places


def without(model, body, joints, points):
    """Return points of a scan without those on some joints and what they carry."""
    names = list(usual_joint_names(model))
    lost = {names.index(joint) for joint in joints}
    for k in map(int, model.joint_order):
        if int(model.parents[k]) in lost:
            lost.add(k)
    owners = model.weights.argmax(axis=1)[cKDTree(body).query(points)[1]]
    return points[~np.isin(owners, sorted(lost))]


def limb_parts(registration, seed, numbers=None):
    """Yield the parts of all limbs of registered scans, and of bodies deliberately wrong.

    `numbers` are those of the scans, all by None.
    """
    scans = scans_of_limbs(registration.model, seed)
    for number, (kind, points, truth, places) in enumerate(scans):
        if numbers is not None and number not in numbers:
            continue
        rng = np.random.default_rng([seed, 49, number])
        task = task_of(registration, points)
        first = register_scan(task)
        yield from _parts_of((kind, ""), first, truth, places)
        if not first.verdict.trusted:
            continue
        for change, trace in wrong_limbs(first, rng):
            yield from _parts_of((kind, change), trace, truth, places)


def wrong_limbs(trace, rng):
    """Yield names and stages of a registered body with limbs turned away or exchanged.

    Closest points would often turn a limb back, so the prior holds its first joint where it is.
    """
    body, (task, pose) = trace.search.body, (trace.arms.task, trace.elastic.pose)
    for joint in _TURNED:
        name = f"{('left', 'right')[rng.integers(2)]}_{joint}"
        degrees, axis = rng.uniform(_LEAST_DEGREES, _MOST_DEGREES), rng.standard_normal(3)
        turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis))
        (number,) = body.parts.numbers(name)
        local, expected = pose.local.copy(), task.prior.local.copy()
        local[number] = expected[number] = local[number] @ turn.as_matrix()
        precisions = task.prior.precisions.copy()
        precisions[number] = _HELD
        prior = task.prior._replace(local=expected, precisions=precisions)
        start = pose._replace(local=local)
        yield f"{name} by {degrees:.0f} degrees", _fitted_again(trace, start, prior)
    for joint in crossing_joints(body, pose):
        for start, prior in exchanged_limbs(task, pose, joint):
            yield f"limbs below the {joint}s exchanged", _fitted_again(trace, start, prior)


def _fitted_again(trace, start, prior):
    """Return the stages of a registration whose pose is fitted again, with another prior."""
    task, scan = replace(trace.arms.task, prior=prior), trace.search.scan
    scales = DENSE_SCALES
    pose = fit_closest(task.samples, start, prior, task.scan, scales)
    fitted = BodyFit(task, leave_model(task, pose), {}, {})
    fitted, shown = leave_out_lost_limbs(fitted, scan, is_refused=False)
    verdict = judge(trace.search, fitted, shown, unit_is_known=True)
    return replace(trace, elastic=fitted.fit, verdict=verdict)


def _parts_of(names, trace, truth, places):
    """Yield what is known about every part of a limb that a scan shows; names are two."""
    body, verdict = trace.search.body, trace.verdict
    surface, faces = trace.elastic.points, body.model.faces
    owners, trusted = body.parts.owners, verdict.trusted_vertices
    if places is not None:
        on_model = faces[places.triangles, 0]
        surface, owners, trusted = (
            points_at(places, surface, faces),
            owners[on_model],
            trusted[on_model],
        )
    shown = cKDTree(trace.search.scan.points).query(truth)[0] < _SHOWN_METRES
    errors = np.linalg.norm(surface - truth, axis=1)
    for k, name in enumerate(body.parts.names):
        chosen, (side, _, joint) = shown & (owners == k), name.partition("_")
        if joint in (*_TURNED, "wrist") and chosen.sum() > _LEAST_SHOWN * (owners == k).sum():
            carriers = body.parts.numbers(name)
            if joint in _CARRIED_BY:
                carriers += body.parts.numbers(f"{side}_{_CARRIED_BY[joint]}")
            yield LimbPart(
                *names,
                name,
                float(errors[chosen].mean()),
                float(verdict.excess[carriers].max()),
                float(trusted[chosen].mean()),
                verdict.trusted,
            )

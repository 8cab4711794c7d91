"""Intrinsic and extrinsic codes of point clouds."""

import numpy as np
import pytest
from evaluate_codes import UnseenBodies, mean_error

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.learned import IntrinsicExtrinsicCodes
from riemhuman.surfaces import spectrum


@pytest.fixture(scope="module")
def codes():
    return IntrinsicExtrinsicCodes.load_pretrained()


@pytest.fixture(scope="module")
def bodies():
    return UnseenBodies("plain")


def test_spectra_and_points_are_told_from_codes(codes, bodies):
    points = bodies.points[::17]
    found = codes.transform(points)
    faces = bodies.model.faces
    wanted = [spectrum(f, faces, codes.n_eigenvalues).eigenvalues for f in points]
    told = codes.spectra(found)
    usual = np.exp(np.log(wanted).mean(axis=0))
    error = np.abs(told / wanted - 1.0).mean()
    assert error < 0.8 * np.abs(usual / wanted - 1.0).mean()
    placed = codes.inverse_transform(found)
    usual = np.broadcast_to(points[:, codes.vertices_].mean(axis=0), placed.shape)
    seen = points[:, codes.vertices_]
    assert mean_error(placed, seen) < 0.6 * mean_error(usual, seen)


def test_codes_need_no_registration(codes):
    bodies = [load_open_model(name) for name in ("coarse", "full")]
    found = np.stack([codes.describe(body(), body.faces) for body in bodies])
    others = codes.transform(UnseenBodies("plain").points[:20])
    assert np.linalg.norm(found[0] - found[1]) < 0.5 * np.linalg.norm(others.std(axis=0))
    on_full = codes.on(bodies[1].template)
    np.testing.assert_allclose(on_full.transform(bodies[1]()[None])[0], found[1])


def test_refuses_and_describes(codes, bodies):
    with pytest.raises(ArgumentError, match="unit that the network was trained in"):
        codes.describe(1000.0 * bodies.points[0], bodies.model.faces)
    with pytest.raises(ArgumentError, match="Z"):
        codes.spectra(np.zeros((2, 7)))
    found = [codes.describe(f, bodies.model.faces) for f in bodies.points[:2]]
    np.testing.assert_allclose(found, codes.transform(bodies.points[:2]))

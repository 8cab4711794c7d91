"""Deformation bases: orthonormal vectors, streamed principal components, frames of motions."""

import autograd.numpy as anp
import numpy as np
import pytest
import trimesh
from autograd.test_util import check_grads

from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.surfaces.deformation_basis import (
    DeformationBasis,
    frames_apart,
    singular_rows,
)
from riemhuman.surfaces.spectra import harmonics
from riemhuman.surfaces.template import Template

MESH = trimesh.creation.icosphere(subdivisions=2)
TEMPLATE = Template(MESH.vertices * [1.0, 1.5, 0.7], MESH.faces)
N_VERTICES = TEMPLATE.n_vertices


def motions(n_motions=6, n_frames=52, rank=30, seed=0):
    """Return smooth motions of the template within a space of known dimension."""
    rng = np.random.default_rng(seed)
    modes = rng.normal(size=(rank, N_VERTICES, 3)) * 0.85 ** np.arange(rank)[:, None, None]
    times = np.arange(n_frames)[:, np.newaxis]
    found = []
    for _ in range(n_motions):
        phase, speed = rng.uniform(0, 6, rank), rng.uniform(0.05, 0.4, rank)
        found.append(TEMPLATE.vertices + np.tensordot(np.sin(times * speed + phase), modes, 1))
    return found


def deformations(found, step=10):
    return np.concatenate([np.diff(motion[::step], axis=0) for motion in found])


def oracle(found):
    """Return variances, ratios and vectors by one decomposition of all deformations."""
    rows = deformations(found).reshape(-1, 3 * N_VERTICES)
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    vectors = right.reshape(-1, N_VERTICES, 3)
    return values**2 / len(rows), values**2 / np.sum(values**2), vectors


def gram(basis):
    return basis.flat @ basis.flat.T


@pytest.fixture(scope="module")
def basis():
    return DeformationBasis.from_motions(motions(), 12)


class TestFromMotions:
    def test_agrees_with_one_decomposition_of_all(self, basis):
        variance, ratio, vectors = oracle(motions())
        np.testing.assert_allclose(basis.explained_variance, variance[:12], rtol=1e-11)
        np.testing.assert_allclose(basis.explained_variance_ratio, ratio[:12], rtol=1e-11)
        signs = np.sign(np.sum(basis.vectors * vectors[:12], axis=(1, 2)))
        expected = signs[:, np.newaxis, np.newaxis] * vectors[:12]
        np.testing.assert_allclose(basis.vectors, expected, atol=1e-11)
        np.testing.assert_allclose(gram(basis), np.eye(12), atol=1e-13)
        squares = basis.coefficients(deformations(motions())) ** 2
        np.testing.assert_allclose(squares.mean(axis=0), basis.explained_variance, rtol=1e-11)

    def test_motions_beyond_the_memory_come_close(self, basis):
        squeezed = DeformationBasis.from_motions((motion for motion in motions(20)), 12, memory=1)
        exact = oracle(motions(20))
        np.testing.assert_allclose(squeezed.explained_variance, exact[0][:12], rtol=0.05)
        np.testing.assert_allclose(squeezed.explained_variance[:4], exact[0][:4], rtol=1e-3)
        np.testing.assert_allclose(gram(squeezed), np.eye(12), atol=1e-13)

    @pytest.mark.parametrize("scale", [1.0, 1e-5], ids=["large", "tiny"])
    def test_rank_is_said_where_too_much_is_asked(self, scale):
        found = [
            TEMPLATE.vertices + scale * (motion - TEMPLATE.vertices) for motion in motions(rank=7)
        ]
        with pytest.raises(ArgumentError, match=r"n_components=8 exceeds the rank 7 of the 30"):
            DeformationBasis.from_motions(found, 8)


class TestFromLaplacian:
    @pytest.mark.parametrize("n_components", [30, 31])
    def test_harmonics_come_along_three_axes(self, n_components):
        basis = DeformationBasis.from_laplacian(TEMPLATE, n_components)
        assert len(basis) == n_components
        np.testing.assert_allclose(gram(basis), np.eye(n_components), atol=1e-12)
        for k, vector in enumerate(basis.vectors):
            assert not np.delete(vector, k % 3, axis=1).any()
            np.testing.assert_array_equal(vector[:, k % 3], basis.vectors[k - k % 3, :, 0])
        assert basis.explained_variance is None

    def test_it_spans_the_lowest_harmonics_in_their_order(self):
        basis = DeformationBasis.from_laplacian(TEMPLATE, 30)
        _, functions = harmonics(TEMPLATE, 10)
        for count in range(1, 11):
            deformation = np.stack([functions[count - 1]] * 3, axis=-1)
            first = basis.truncate(3 * count)
            np.testing.assert_allclose(first.project(deformation), deformation, atol=1e-9)

    def test_too_many_are_refused(self):
        with pytest.raises(ArgumentError, match=f"exceeds the {N_VERTICES - 1} of a mesh"):
            DeformationBasis.from_laplacian(TEMPLATE, 3 * N_VERTICES)


class TestVectors:
    def test_orthonormal_vectors_are_copied_and_frozen(self, basis):
        values = basis.vectors.copy()
        again = DeformationBasis(values)
        values[:] = 0.0
        np.testing.assert_array_equal(again.vectors, basis.vectors)
        with pytest.raises(ValueError, match="read-only"):
            again.vectors[0, 0, 0] = 1.0
        assert again.flat.shape == (12, 3 * N_VERTICES)
        assert again.explained_variance is again.explained_variance_ratio is None

    def test_deviation_is_told(self, basis):
        skewed = basis.vectors.copy()
        skewed[0] *= 1.25
        with pytest.raises(ArgumentError, match=r"up to 0\.562: .* orthonormalize=True"):
            DeformationBasis(skewed)
        nearly = basis.vectors.copy()
        nearly[0] *= 1 + 2e-9
        DeformationBasis(nearly)
        nearly[0] *= 1 + 2e-8
        with pytest.raises(ArgumentError, match="orthonormal"):
            DeformationBasis(nearly)

    def test_orthonormalized_in_their_order(self):
        given = np.random.default_rng(1).normal(size=(6, N_VERTICES, 3))
        basis = DeformationBasis(given, orthonormalize=True)
        np.testing.assert_allclose(gram(basis), np.eye(6), atol=1e-13)
        coefficients = basis.coefficients(given)
        np.testing.assert_allclose(coefficients, np.tril(coefficients), atol=1e-12)
        assert (coefficients.diagonal() > 0).all()
        np.testing.assert_allclose(basis.combine(coefficients), given, atol=1e-12)

    def test_dependent_vectors_are_refused_with_their_rank(self):
        given = np.random.default_rng(1).normal(size=(6, N_VERTICES, 3))
        given[4] = given[0] - 2 * given[3]
        with pytest.raises(ArgumentError, match="the rank of these 6 is 5"):
            DeformationBasis(given, orthonormalize=True)


class TestAlgebra:
    def test_coefficients_and_combine_are_inverse(self, basis):
        coefficients = np.random.default_rng(2).normal(size=(4, 5, 12))
        combined = basis.combine(coefficients)
        assert combined.shape == (4, 5, N_VERTICES, 3)
        expected = np.tensordot(coefficients[1, 2], basis.vectors, 1)
        np.testing.assert_allclose(combined[1, 2], expected, atol=1e-13)
        np.testing.assert_allclose(basis.coefficients(combined), coefficients, atol=1e-12)
        alone = basis.coefficients(combined[0, 0])
        np.testing.assert_allclose(alone, coefficients[0, 0], atol=1e-12)

    @pytest.mark.parametrize("shape", [(12,), (2, 12)])
    def test_autograd_passes(self, basis, shape):
        point = np.random.default_rng(4).normal(size=shape)
        check_grads(lambda alpha: anp.sum(anp.sin(basis.combine(alpha))), modes=["rev"])(point)
        deformation = basis.combine(point)
        check_grads(lambda d: anp.sum(basis.coefficients(d) ** 3), modes=["rev"])(deformation)

    def test_truncated(self, basis):
        first = basis.truncate(5)
        for name in ("vectors", "explained_variance", "explained_variance_ratio"):
            np.testing.assert_array_equal(getattr(first, name), getattr(basis, name)[:5])
        assert DeformationBasis(basis.vectors).truncate(1).explained_variance is None
        with pytest.raises(ArgumentError, match="n_components=13 exceeds the 12 vectors"):
            basis.truncate(13)
        with pytest.raises(ArgumentError, match="n_components"):
            basis.truncate(0)

    def test_check_fits(self, basis):
        basis.check_fits(TEMPLATE)
        basis.check_fits(N_VERTICES)
        other = Template(np.eye(3), [[0, 1, 2]])
        for template in (other, 3):
            with pytest.raises(ArgumentError, match="has 162 vertices, the template has 3"):
                basis.check_fits(template)


class TestFiles:
    def test_round_trip(self, basis, tmp_path):
        basis.save(tmp_path / "basis.npz")
        again = DeformationBasis.load(tmp_path / "basis.npz")
        for name in ("vectors", "explained_variance", "explained_variance_ratio"):
            np.testing.assert_array_equal(getattr(again, name), getattr(basis, name))
            assert not getattr(again, name).flags.writeable
        DeformationBasis(basis.vectors).save(tmp_path / "vectors.npz")
        assert DeformationBasis.load(tmp_path / "vectors.npz").explained_variance is None

    def test_what_is_missing_or_wrong_is_named(self, basis, tmp_path):
        file = tmp_path / "basis.npz"
        good = {"format_version": 1, "vectors": basis.vectors}
        for change, message in [
            ({"vectors": None}, r"basis\.npz: lacks the fields vectors"),
            ({"vectors": 2 * basis.vectors}, r"basis\.npz: vectors must be orthonormal"),
            ({"explained_variance": np.ones(3)}, "explained_variance must have shape"),
        ]:
            fields = {k: v for k, v in (good | change).items() if v is not None}
            np.savez(file, **fields)
            with pytest.raises(FileFormatError, match=message):
                DeformationBasis.load(file)


def test_small_singular_values_survive():
    """Down to 1e-11, whose square is beyond double precision."""
    rng, decay = np.random.default_rng(0), 0.1 ** np.arange(12.0)
    left, right = (np.linalg.qr(rng.normal(size=(n, 12)))[0] for n in (12, 50))
    values, *_ = singular_rows(iter((left * decay) @ right.T), 12, 50)
    np.testing.assert_allclose(values, decay, rtol=1e-4)


MOTION = np.random.default_rng(0).normal(size=(24, 5, 3))


class Indexed:
    """A motion whose frames are computed when asked for."""

    def __init__(self, frames):
        self.frames = frames
        self.asked = []

    def __len__(self):
        return len(self.frames)

    def __getitem__(self, number):
        self.asked.append(number)
        return self.frames[number]


def reusing_one_array():
    frame = np.empty((5, 3))
    for values in MOTION:
        frame[:] = values
        yield frame


@pytest.mark.parametrize(
    "make",
    [
        lambda: MOTION,
        lambda: list(MOTION),
        lambda: iter(MOTION),
        reusing_one_array,
        lambda: Indexed(MOTION),
        lambda: MOTION.tolist(),
    ],
    ids=["array", "list", "iterator", "reusing", "indexed", "nested lists"],
)
def test_every_kind_of_motion_gives_the_same_pairs(make):
    pairs = list(frames_apart([make(), make()], step=5))
    assert len(pairs) == 8
    for n, (start, end) in enumerate(pairs):
        np.testing.assert_array_equal(start, MOTION[n % 4 * 5])
        np.testing.assert_array_equal(end, MOTION[n % 4 * 5 + 5])


def with_bad_entry(number):
    motion = MOTION.copy()
    motion[number, 2, 1] = np.nan
    return motion


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("motions", "error", "message"),
    [
        ([MOTION, MOTION[:10]], ArgumentError, r"motions\[1\] has 10 frames; with step=10 .* 11"),
        ([MOTION, MOTION[:, :4]], ArgumentError, r"motions\[1\] has 4 vertices; .* have 5"),
        ([[*MOTION[:3], MOTION[3, :4]]], ArgumentError, r"frame 3 of .* 4 vertices; .* 5"),
        ([MOTION, with_bad_entry(10)], ArgumentError, r"frame 10 of motions\[1\] holds 1 NaN"),
        (MOTION, ArgumentError, r"found one, of shape \(24, 5, 3\)"),
    ],
)
def test_refusals_say_which(motions, error, message):
    with pytest.raises(error, match=message):
        list(frames_apart(motions, step=10))


def test_what_is_nearly_in_the_basis_extends_it():
    """The remainder is a few billionths: a first projection leaves rounding errors inside."""
    rng = np.random.default_rng(0)
    basis = DeformationBasis(rng.normal(size=(4, 30, 3)), orthonormalize=True)
    inside = np.tensordot([3.0, -1.0, 2.0, 5.0], basis.vectors, axes=1)
    extended = basis.extend((inside + 3e-9 * rng.normal(size=(30, 3)))[None])
    assert len(extended) == 5
    np.testing.assert_allclose(extended.flat @ extended.flat.T, np.eye(5), atol=1e-12)
    with pytest.raises(ArgumentError, match="deformations must have shape"):
        basis.extend(inside)
    assert basis.extend(inside[None][:0]) is basis
    assert basis.project(inside[None][:0]).shape == (0, 30, 3)

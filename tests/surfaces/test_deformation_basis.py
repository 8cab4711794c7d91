"""Deformation bases: orthonormal vectors, streamed principal components, frames of motions."""

import autograd.numpy as anp
import numpy as np
import pytest
import trimesh
from autograd.test_util import check_grads
from sklearn.decomposition import PCA

from riemhuman.errors import ArgumentError, ArgumentTypeError, FileError, FileFormatError
from riemhuman.surfaces import deformation_basis
from riemhuman.surfaces.deformation_basis import (
    DeformationBasis,
    StreamingPCA,
    frames_apart,
)
from riemhuman.surfaces.spectra import harmonics
from riemhuman.surfaces.template import Template

MESH = trimesh.creation.icosphere(subdivisions=2)
TEMPLATE = Template(MESH.vertices * [1.0, 1.5, 0.7], MESH.faces)
N_VERTICES = TEMPLATE.n_vertices
UNEVEN = np.random.default_rng(9).uniform(0.2, 3.0, N_VERTICES)


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


def oracle(found, weights=None, remove_mean=False):
    """Return variances, ratios and vectors by one decomposition of all deformations."""
    rows = deformations(found)
    roots = np.ones(N_VERTICES) if weights is None else np.sqrt(weights / weights.mean())
    rows = (rows * roots[:, np.newaxis]).reshape(len(rows), -1)
    if remove_mean:
        rows = rows - rows.mean(axis=0)
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    vectors = right.reshape(-1, N_VERTICES, 3) / roots[:, np.newaxis]
    divisor = len(rows) - 1 if remove_mean else len(rows)
    return values**2 / divisor, values**2 / np.sum(values**2), vectors


def gram(basis):
    weights = np.ones(basis.n_vertices) if basis.vertex_weights is None else basis.vertex_weights
    return np.einsum("ivx,jvx,v->ij", basis.vectors, basis.vectors, weights)


@pytest.fixture(scope="module")
def basis():
    return DeformationBasis.from_motions(motions(), 12)


@pytest.fixture(scope="module")
def weighted():
    return DeformationBasis.from_motions(motions(), 12, vertex_weights=UNEVEN)


class TestFromMotions:
    @pytest.mark.parametrize("weights", [None, UNEVEN], ids=["plain", "weighted"])
    @pytest.mark.parametrize("remove_mean", [False, True])
    def test_agrees_with_one_decomposition_of_all(self, weights, remove_mean):
        basis = DeformationBasis.from_motions(
            motions(), 12, remove_mean=remove_mean, vertex_weights=weights
        )
        variance, ratio, vectors = oracle(motions(), weights, remove_mean)
        np.testing.assert_allclose(basis.explained_variance, variance[:12], rtol=1e-11)
        np.testing.assert_allclose(basis.explained_variance_ratio, ratio[:12], rtol=1e-11)
        signs = np.sign(np.sum(basis.vectors * vectors[:12], axis=(1, 2)))
        np.testing.assert_allclose(
            basis.vectors, signs[:, np.newaxis, np.newaxis] * vectors[:12], atol=1e-11
        )
        if remove_mean:
            np.testing.assert_allclose(basis.mean, deformations(motions()).mean(axis=0), atol=1e-14)
        else:
            assert basis.mean is None

    def test_variance_is_that_of_the_coefficients(self, basis, weighted):
        for one in (basis, weighted):
            coefficients = one.coefficients(deformations(motions()))
            np.testing.assert_allclose(
                np.mean(coefficients**2, axis=0), one.explained_variance, rtol=1e-11
            )

    @pytest.mark.parametrize("name", ["basis", "weighted"])
    def test_vectors_are_orthonormal(self, name, request):
        np.testing.assert_allclose(gram(request.getfixturevalue(name)), np.eye(12), atol=1e-13)

    def test_motions_beyond_the_buffer_come_close(self, basis, monkeypatch):
        monkeypatch.setattr(deformation_basis, "_BUFFER_BYTES", 1)
        squeezed = DeformationBasis.from_motions((motion for motion in motions(20)), 12)
        exact = oracle(motions(20))
        np.testing.assert_allclose(squeezed.explained_variance, exact[0][:12], rtol=0.05)
        np.testing.assert_allclose(squeezed.explained_variance[:4], exact[0][:4], rtol=1e-3)
        np.testing.assert_allclose(gram(squeezed), np.eye(12), atol=1e-13)

    @pytest.mark.parametrize("buffer_bytes", [2**28, 1])
    def test_low_rank_motion_is_reproduced(self, buffer_bytes, monkeypatch):
        monkeypatch.setattr(deformation_basis, "_BUFFER_BYTES", buffer_bytes)
        found = motions(30, rank=7)
        basis = DeformationBasis.from_motions(found, 7)
        seen = deformations(found, step=3)  # others than those it was made of
        np.testing.assert_allclose(basis.project(seen), seen, atol=1e-12)
        assert basis.explained_variance_ratio.sum() == pytest.approx(1.0, abs=1e-12)

    @pytest.mark.parametrize("scale", [1.0, 1e-5], ids=["large", "tiny"])
    def test_rank_is_said_where_too_much_is_asked(self, scale):
        found = [
            TEMPLATE.vertices + scale * (motion - TEMPLATE.vertices) for motion in motions(rank=7)
        ]
        with pytest.raises(ArgumentError, match=r"n_components=8 exceeds the rank 7 of the 30"):
            DeformationBasis.from_motions(found, 8)
        with pytest.raises(ArgumentError, match="rank 7 of the 30 deformations less their mean"):
            DeformationBasis.from_motions(found, 100, remove_mean=True)

    def test_motion_without_movement_is_refused(self):
        with pytest.raises(ArgumentError, match="rank 0 of the 2 deformations"):
            DeformationBasis.from_motions([np.repeat(TEMPLATE.vertices[None], 21, axis=0)], 1)


class TestFromLaplacian:
    @pytest.mark.parametrize("weights", [None, UNEVEN])
    @pytest.mark.parametrize("n_components", [30, 31])
    def test_harmonics_come_along_three_axes(self, weights, n_components):
        basis = DeformationBasis.from_laplacian(TEMPLATE, n_components, vertex_weights=weights)
        assert len(basis) == n_components
        np.testing.assert_allclose(gram(basis), np.eye(n_components), atol=1e-12)
        for k, vector in enumerate(basis.vectors):
            assert not np.delete(vector, k % 3, axis=1).any()
            np.testing.assert_array_equal(vector[:, k % 3], basis.vectors[k - k % 3, :, 0])
        assert basis.explained_variance is None
        assert basis.mean is None

    @pytest.mark.parametrize("weights", [None, UNEVEN])
    def test_it_spans_the_lowest_harmonics_in_their_order(self, weights):
        basis = DeformationBasis.from_laplacian(TEMPLATE, 30, vertex_weights=weights)
        _, functions = harmonics(TEMPLATE, 10)
        for count in range(1, 11):
            deformation = np.stack([functions[count - 1]] * 3, axis=-1)
            first = basis.truncate(3 * count)
            np.testing.assert_allclose(first.project(deformation), deformation, atol=1e-9)

    def test_area_weights_leave_eigenfunctions_as_they_are(self):
        basis = DeformationBasis.from_laplacian(TEMPLATE, 30, vertex_weights=TEMPLATE.vertex_areas)
        _, functions = harmonics(TEMPLATE, 10)
        scale = np.sqrt(TEMPLATE.vertex_areas.mean())
        np.testing.assert_allclose(basis.vectors[::3, :, 0], scale * functions, atol=1e-9)

    def test_translations_are_left_out(self):
        box = trimesh.creation.box()
        template = Template(box.vertices, box.faces)
        basis = DeformationBasis.from_laplacian(template, 3 * (template.n_vertices - 1))
        translation = np.broadcast_to([1.0, 2.0, 3.0], (template.n_vertices, 3))
        matrix = np.concatenate([basis.flat, translation.reshape(1, -1)])
        assert np.linalg.matrix_rank(matrix, tol=1e-8) == len(basis) + 1

    def test_too_many_are_refused(self):
        with pytest.raises(ArgumentError, match=f"exceeds the {N_VERTICES - 1} of a mesh"):
            DeformationBasis.from_laplacian(TEMPLATE, 3 * N_VERTICES)
        with pytest.raises(ArgumentError, match="vertex_weights"):
            DeformationBasis.from_laplacian(TEMPLATE, 3, vertex_weights=np.zeros(N_VERTICES))


class TestVectors:
    def test_orthonormal_vectors_are_copied_and_frozen(self, basis):
        values = basis.vectors.copy()
        again = DeformationBasis(values)
        values[:] = 0.0
        np.testing.assert_array_equal(again.vectors, basis.vectors)
        with pytest.raises(ValueError, match="read-only"):
            again.vectors[0, 0, 0] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            again.flat[0, 0] = 1.0
        assert again.flat.flags.c_contiguous
        assert np.shares_memory(again.flat, again.vectors)
        assert again.flat.shape == (12, 3 * N_VERTICES)
        assert (again.n_components, len(again), again.n_vertices) == (12, 12, N_VERTICES)
        assert again.explained_variance is again.explained_variance_ratio is again.mean is None

    def test_deviation_is_told(self, basis):
        skewed = basis.vectors.copy()
        skewed[0] *= 1.25
        with pytest.raises(ArgumentError, match=r"up to 0\.562 away .* orthonormalize=True"):
            DeformationBasis(skewed)
        with pytest.raises(ArgumentError, match="orthonormal"):
            DeformationBasis(basis.vectors, vertex_weights=UNEVEN)
        nearly = basis.vectors.copy()
        nearly[0] *= 1 + 2e-9
        DeformationBasis(nearly)
        nearly[0] *= 1 + 2e-8
        with pytest.raises(ArgumentError, match="orthonormal"):
            DeformationBasis(nearly)

    @pytest.mark.parametrize("weights", [None, UNEVEN])
    def test_orthonormalized_in_their_order(self, weights):
        given = np.random.default_rng(1).normal(size=(6, N_VERTICES, 3))
        basis = DeformationBasis(given, orthonormalize=True, vertex_weights=weights)
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

    @pytest.mark.parametrize(
        ("vectors", "error"),
        [
            (np.zeros((0, 5, 3)), ArgumentError),
            (np.zeros((2, 5)), ArgumentError),
            (np.full((1, 5, 3), np.nan), ArgumentError),
            ([["a"]], ArgumentTypeError),
        ],
    )
    def test_what_is_no_basis(self, vectors, error):
        with pytest.raises(error, match="vectors"):
            DeformationBasis(vectors)


class TestAlgebra:
    @pytest.mark.parametrize("name", ["basis", "weighted"])
    def test_coefficients_and_combine_are_inverse(self, name, request):
        one = request.getfixturevalue(name)
        coefficients = np.random.default_rng(2).normal(size=(4, 5, 12))
        combined = one.combine(coefficients)
        assert combined.shape == (4, 5, N_VERTICES, 3)
        np.testing.assert_allclose(
            combined[1, 2], np.tensordot(coefficients[1, 2], one.vectors, 1), atol=1e-13
        )
        np.testing.assert_allclose(one.coefficients(combined), coefficients, atol=1e-12)
        np.testing.assert_allclose(one.coefficients(combined[0, 0]), coefficients[0, 0], atol=1e-12)

    @pytest.mark.parametrize("name", ["basis", "weighted"])
    def test_projection_is_the_nearest_combination(self, name, request):
        one = request.getfixturevalue(name)
        deformation = np.random.default_rng(3).normal(size=(N_VERTICES, 3))
        residual = deformation - one.project(deformation)
        np.testing.assert_allclose(one.coefficients(residual), 0.0, atol=1e-12)
        roots = 1.0 if one.vertex_weights is None else np.sqrt(one.vertex_weights)
        matrix = (one.vectors * np.reshape(roots, (-1, 1))).reshape(12, -1).T
        target = (deformation * np.reshape(roots, (-1, 1))).ravel()
        nearest = np.linalg.lstsq(matrix, target, rcond=None)[0]
        np.testing.assert_allclose(one.coefficients(deformation), nearest, atol=1e-11)

    @pytest.mark.parametrize("shape", [(12,), (2, 12)])
    def test_autograd_passes(self, weighted, shape):
        point = np.random.default_rng(4).normal(size=shape)
        check_grads(lambda alpha: anp.sum(anp.sin(weighted.combine(alpha))), modes=["rev"])(point)
        deformation = weighted.combine(point)
        check_grads(lambda d: anp.sum(weighted.coefficients(d) ** 3), modes=["rev"])(deformation)

    def test_wrong_shapes_are_refused(self, basis):
        with pytest.raises(ArgumentError, match="coefficients"):
            basis.combine(np.zeros(11))
        with pytest.raises(ArgumentError, match="deformation"):
            basis.coefficients(np.zeros((5, 3)))
        with pytest.raises(ArgumentError, match="deformation"):
            basis.project(np.full((N_VERTICES, 3), np.inf))

    def test_truncated(self):
        full = DeformationBasis.from_motions(motions(), 12, remove_mean=True, vertex_weights=UNEVEN)
        first = full.truncate(5)
        np.testing.assert_array_equal(first.vectors, full.vectors[:5])
        np.testing.assert_array_equal(first.explained_variance, full.explained_variance[:5])
        np.testing.assert_array_equal(
            first.explained_variance_ratio, full.explained_variance_ratio[:5]
        )
        np.testing.assert_array_equal(first.mean, full.mean)
        np.testing.assert_allclose(first.vertex_weights, full.vertex_weights, rtol=1e-15)
        assert DeformationBasis(full.vectors, vertex_weights=UNEVEN).truncate(1).mean is None
        with pytest.raises(ArgumentError, match="n_components=13 exceeds the 12 vectors"):
            full.truncate(13)
        with pytest.raises(ArgumentError, match="n_components"):
            full.truncate(0)

    def test_check_fits(self, basis):
        basis.check_fits(TEMPLATE)
        basis.check_fits(N_VERTICES)
        other = Template(np.eye(3), [[0, 1, 2]])
        for template in (other, 3):
            with pytest.raises(ArgumentError, match="has 162 vertices, the template has 3"):
                basis.check_fits(template)


class TestFiles:
    @pytest.mark.parametrize("options", [{}, {"remove_mean": True, "vertex_weights": UNEVEN}])
    def test_round_trip(self, options, tmp_path):
        basis = DeformationBasis.from_motions(motions(), 12, **options)
        basis.save(tmp_path / "basis.npz")
        again = DeformationBasis.load(tmp_path / "basis.npz")
        np.testing.assert_array_equal(again.vectors, basis.vectors)
        for name in ("vertex_weights", "explained_variance", "explained_variance_ratio", "mean"):
            expected, found = getattr(basis, name), getattr(again, name)
            if expected is None:
                assert found is None
            else:
                np.testing.assert_allclose(found, expected, rtol=1e-15)
                assert not found.flags.writeable

    def test_what_is_missing_or_wrong_is_named(self, basis, tmp_path):
        file = tmp_path / "basis.npz"
        with pytest.raises(FileError, match=r"basis\.npz"):
            DeformationBasis.load(file)
        with pytest.raises(FileError, match="nowhere"):
            basis.save(tmp_path / "nowhere" / "basis.npz")
        file.write_bytes(b"garbage")
        with pytest.raises(FileFormatError, match=r"basis\.npz is not an \.npz archive"):
            DeformationBasis.load(file)

        good = {"format_version": 1, "vectors": basis.vectors}
        for change, message in [
            ({"vectors": None}, r"basis\.npz lacks the fields vectors"),
            ({"format_version": None}, "lacks the fields format_version"),
            ({"format_version": 2}, "has format version 2; this release reads version 1"),
            ({"vectors": 2 * basis.vectors}, r"basis\.npz: vectors must be orthonormal"),
            ({"vectors": np.array(["text"])}, r"basis\.npz: vectors must be an array of real"),
            ({"explained_variance": np.ones(3)}, "explained_variance must have shape"),
            ({"mean": np.ones((3, 3))}, "mean must have shape"),
            ({"vertex_weights": np.zeros(N_VERTICES)}, "not positive"),
        ]:
            fields = {k: v for k, v in (good | change).items() if v is not None}
            np.savez(file, **fields)
            with pytest.raises(FileFormatError, match=message):
                DeformationBasis.load(file)


def rows_with_decay(n_rows, n_features, decay, seed=0, shift=0.0):
    """Return rows whose singular values fall off by the factor `decay` from one to the next."""
    rng = np.random.default_rng(seed)
    rank = min(n_rows, n_features)
    left = np.linalg.qr(rng.normal(size=(n_rows, rank)))[0]
    right = np.linalg.qr(rng.normal(size=(n_features, rank)))[0]
    return (left * decay ** np.arange(rank)) @ right.T + shift


def streamed(rows, n_components, **options):
    pca = StreamingPCA(n_components, rows.shape[1], **options)
    for row in rows:
        pca.add(row)
    return pca.components()


def assert_same_up_to_sign(found, expected, tolerance):
    cosines = np.abs(np.sum(found * expected, axis=1))
    np.testing.assert_allclose(cosines, 1.0, atol=tolerance)


def test_rows_in_the_buffer_give_the_full_decomposition():
    rows = rows_with_decay(60, 90, 0.8)
    found = streamed(rows, 20)
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    np.testing.assert_allclose(found.variance, values[:20] ** 2 / 60, rtol=1e-12)
    np.testing.assert_allclose(
        found.variance_ratio, values[:20] ** 2 / np.sum(values**2), rtol=1e-12
    )
    assert_same_up_to_sign(found.vectors, right[:20], 1e-12)
    # Falling by 0.8 each, the singular values stay above rounding up to the last one.
    assert (found.rank, found.n_samples, found.mean) == (60, 60, None)


def test_small_singular_values_survive():
    rows = rows_with_decay(12, 50, 0.1)  # down to 1e-11, whose square is beyond double precision
    found = streamed(rows, 12)
    np.testing.assert_allclose(np.sqrt(found.variance * 12), 0.1 ** np.arange(12.0), rtol=1e-4)


@pytest.mark.parametrize("remove_mean", [False, True])
def test_low_rank_is_merged_without_loss(remove_mean):
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(300, 6)) @ rng.normal(size=(6, 80)) + 2.0
    found = streamed(rows, 6, remove_mean=remove_mean, max_rows=18)
    reference = rows - rows.mean(axis=0) if remove_mean else rows
    _, values, right = np.linalg.svd(reference, full_matrices=False)
    divisor = 299 if remove_mean else 300
    np.testing.assert_allclose(found.variance, values[:6] ** 2 / divisor, rtol=1e-11)
    assert_same_up_to_sign(found.vectors, right[:6], 1e-11)
    assert found.rank == (6 if remove_mean else 7)


def test_merges_cost_no_more_than_what_they_drop():
    rows = rows_with_decay(200, 100, 0.95, seed=1)
    found = streamed(rows, 6, max_rows=18)
    exact = np.linalg.svd(rows, compute_uv=False)[:6] ** 2 / 200
    # Truncation only ever lowers variance, and hardly so for the strong components.
    assert (found.variance <= exact * (1 + 1e-12)).all()
    assert (found.variance > 0.8 * exact).all()
    finer = streamed(rows, 6, max_rows=72)
    assert np.abs(finer.variance - exact).max() < 0.1 * np.abs(found.variance - exact).max()


@pytest.mark.parametrize("max_rows", [None, 40])
def test_mean_removal_agrees_with_scikit_learn(max_rows):
    rows = rows_with_decay(130, 70, 0.5, seed=2, shift=3.0)
    found = streamed(rows, 8, remove_mean=True, max_rows=max_rows)
    expected = PCA(8, svd_solver="full").fit(rows)
    np.testing.assert_allclose(found.mean, expected.mean_, rtol=1e-12)
    np.testing.assert_allclose(found.variance, expected.explained_variance_, rtol=1e-9)
    np.testing.assert_allclose(found.variance_ratio, expected.explained_variance_ratio_, rtol=1e-9)
    assert_same_up_to_sign(found.vectors, expected.components_, 1e-9)


def test_rounding_does_not_count_as_rank():
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(20, 2)) @ rng.normal(size=(2, 30)) * 1e-6
    noisy = rows + 1e-16 * rng.normal(size=rows.shape)
    pca = StreamingPCA(20, 30)
    for row in noisy:
        pca.add(row)
    assert pca.components().rank > 2
    assert pca.components(rounding=3e-16).rank == 2


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
        lambda: [MOTION[:7], MOTION[7:8], MOTION[8], MOTION[9:]],
        lambda: (run for run in np.split(MOTION, 4)),
        reusing_one_array,
        lambda: Indexed(MOTION),
        lambda: MOTION.tolist(),
    ],
    ids=["array", "list", "iterator", "mixed", "runs", "reusing", "indexed", "nested lists"],
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


@pytest.mark.parametrize(
    ("motions", "error", "message"),
    [
        ([], ArgumentError, "motions holds no motion"),
        ([MOTION, MOTION[:10]], ArgumentError, r"motions\[1\] has 10 frames; with step=10 .* 11"),
        ([Indexed(MOTION[:4])], ArgumentError, r"motions\[0\] has 4 frames"),
        ([iter(())], ArgumentError, r"motions\[0\] has 0 frames"),
        (
            [MOTION, MOTION, MOTION[:, :4]],
            ArgumentError,
            r"motions\[2\] has 4 vertices; the motions before it have 5",
        ),
        (
            [[*MOTION[:3], MOTION[3, :4]]],
            ArgumentError,
            r"frame 3 of motions\[0\] has 4 vertices; .* 5",
        ),
        ([MOTION, with_bad_entry(10)], ArgumentError, r"frame 10 of motions\[1\] holds 1 NaN"),
        ([MOTION, with_bad_entry(7)], ArgumentError, r"frame 7 of motions\[1\] holds 1 NaN"),
        ([[with_bad_entry(7)]], ArgumentError, r"frame 7 of motions\[0\] holds 1 NaN"),
        ([Indexed(with_bad_entry(20))], ArgumentError, r"frame 20 of motions\[0\] holds 1 NaN"),
        (MOTION, ArgumentError, r"found one, of shape \(24, 5, 3\)"),
        ([MOTION[:, :, :2]], ArgumentError, r"frame 0 of motions\[0\] must have shape"),
        ([3.0], ArgumentTypeError, r"motions\[0\] must be an array"),
        (None, ArgumentTypeError, "motions must be an array"),
        (
            ["walking on the spot"],
            ArgumentTypeError,
            r"frame 0 of motions\[0\] must be an array of real",
        ),
    ],
)
def test_refusals_say_which(motions, error, message):
    with pytest.raises(error, match=message):
        list(frames_apart(motions, step=10))

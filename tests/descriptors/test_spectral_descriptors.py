"""ShapeDNA, heat and wave kernel signatures: closed forms, bending, sizes, bad parameters."""

import numpy as np
import pytest
from known_surfaces import (
    flat_torus,
    folded_sheet,
    sheet,
    sphere,
    sphere_spectrum,
    torus_spectrum,
)

from riemhuman.descriptors import (
    HeatKernelSignature,
    ShapeDNA,
    WaveKernelSignature,
)
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.surfaces import spectrum

TIMES = (0.05, 0.1, 0.5)
ENERGIES = (4.0, 4.5, 5.0, 5.5)


def name_of(descriptor):
    words = [value for value in vars(descriptor).values() if isinstance(value, str)]
    return " ".join([type(descriptor).__name__, *words])


def descriptors(n=20):
    return [
        ShapeDNA(n),
        HeatKernelSignature(n_eigenvalues=n),
        WaveKernelSignature(ENERGIES, n_eigenvalues=n),
        WaveKernelSignature(ENERGIES, n_eigenvalues=n, pooling="vertex mean"),
    ]


def test_shape_dna_of_sphere_and_torus():
    exact = sphere_spectrum(24)
    numbers = np.arange(1, 25)
    dna = numbers * ShapeDNA(24).describe(*sphere(4, radius=0.5))
    np.testing.assert_allclose(dna, 4 * exact, rtol=0.02)
    assert (np.diff(dna) >= -1e-9).all()
    torus = numbers[:12] * ShapeDNA(12).describe(*flat_torus(60, 36, 1.0, 0.6))
    np.testing.assert_allclose(torus, torus_spectrum(1.0, 0.6, 12), rtol=0.02)


def test_heat_kernel_of_sphere_and_torus():
    found = HeatKernelSignature(TIMES, n_eigenvalues=80).signatures(*sphere(4))
    degree = np.arange(30)
    for t, values in zip(TIMES, found, strict=True):
        exact = ((2 * degree + 1) * np.exp(-degree * (degree + 1) * t)).sum() / (4 * np.pi)
        np.testing.assert_allclose(values, exact, rtol=0.02)
    found = HeatKernelSignature(TIMES, n_eigenvalues=60).signatures(*flat_torus(40, 24, 1.0, 0.6))
    m = np.arange(-30, 31)
    for t, values in zip(TIMES, found, strict=True):
        along, across = (np.exp(-((2 * np.pi * m / side) ** 2) * t).sum() for side in (1.0, 0.6))
        np.testing.assert_allclose(values, along * across / 0.6, rtol=5e-3)


def test_short_times_see_a_plane():
    signature = HeatKernelSignature((4e-3,), n_eigenvalues=200).signatures(*sheet(41, 25))[0]
    middle = np.argmin(np.linalg.norm(sheet(41, 25)[0] - [0.5, 0.3, 0.0], axis=1))
    assert 4 * np.pi * 4e-3 * signature[middle] == pytest.approx(1.0, rel=0.03)
    # A corner sends heat into a quarter of the plane; the rest is reflected.
    assert 4 * np.pi * 4e-3 * signature[0] == pytest.approx(4.0, rel=0.1)


def test_mean_of_wave_kernel_is_one_on_every_surface():
    vertices, faces = folded_sheet(0.4)
    areas = spectrum(vertices, faces, 5).areas
    found = WaveKernelSignature(ENERGIES, n_eigenvalues=20).signatures(vertices, faces)
    np.testing.assert_allclose(np.average(found, axis=1, weights=areas), 1.0, rtol=1e-9)
    assert found.std() > 0.1


def test_energies_far_from_all_eigenvalues_are_no_division_by_zero():
    far = WaveKernelSignature((-60.0, 60.0), sigma=0.1, n_eigenvalues=5)
    assert np.isfinite(far.signatures(*sheet())).all()


@pytest.mark.parametrize("descriptor", descriptors(), ids=name_of)
def test_folding_changes_nothing_and_stretching_does(descriptor):
    flat, folded = (descriptor.describe(*folded_sheet(angle)) for angle in (0.0, 1.2))
    vertices, faces = folded_sheet(1.2)
    stretched = descriptor.describe(vertices * [1.0, 1.5, 1.0], faces)
    moved = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = descriptor.describe(vertices @ moved + 4.0, faces)
    distances = descriptor.distances([flat, folded, stretched, turned])
    assert distances[0, 1] < 1e-6 * distances[0, 2]
    assert distances[1, 3] < 1e-6 * distances[0, 2]
    np.testing.assert_array_equal(distances, distances.T)
    np.testing.assert_array_equal(np.diagonal(distances), 0.0)


def test_histograms_are_shares_of_the_area():
    mesh = folded_sheet(0.4)
    areas = spectrum(*mesh, 10).areas / spectrum(*mesh, 10).areas.sum()
    wave = WaveKernelSignature(ENERGIES, n_eigenvalues=10, n_bins=5)
    # Bins are of width 0.8; the last also counts larger values.
    bins = np.minimum(wave.signatures(*mesh) / 0.8, 4).astype(int)
    expected = [np.bincount(row, areas, minlength=5) for row in bins]
    np.testing.assert_allclose(wave.describe(*mesh), np.ravel(expected))
    pair = HeatKernelSignature().distances([[0.0, 1.0], [1.0, 0.0]])
    np.testing.assert_array_equal(pair, [[0.0, 2.0], [2.0, 0.0]])


def test_descriptors_that_share_spectra_are_those_that_do_not(monkeypatch, capsys):
    meshes = [folded_sheet(angle) for angle in (0.0, 0.5)]
    sharing = [*descriptors(8), ShapeDNA(5), HeatKernelSignature(n_eigenvalues=6)]
    computed = []

    def counted(*arguments):
        computed.append(arguments)
        return spectrum(*arguments)

    monkeypatch.setattr("riemhuman.descriptors.spectral_descriptors.spectrum", counted)
    vectors, seconds = ShapeDNA.describe_together(sharing, meshes, progress=True)
    assert "2/2" in capsys.readouterr().err
    assert len(computed) == len(meshes)
    for descriptor, found, taken in zip(sharing, vectors, seconds, strict=True):
        np.testing.assert_allclose(found, descriptor.describe_all(meshes), rtol=1e-7, atol=1e-9)
        assert taken > 0
    flat = np.zeros_like(meshes[0][0])
    with pytest.raises(DegenerateSurfaceError, match=r"^body 1: .* has 480 of 480"):
        ShapeDNA.describe_together(sharing, [meshes[0], (flat, meshes[0][1])])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: HeatKernelSignature((1.0, 0.0)),
            r"times must be positive numbers; found \[1.0, 0",
        ),
        (lambda: WaveKernelSignature((2.0, 2.0)), "at least two different numbers, or one if"),
    ],
)
def test_bad_parameters(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()

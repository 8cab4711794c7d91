"""Seams: cut bodies, triangle soups, lips, touching borders, rounding."""

import numpy as np
import pytest
from known_surfaces import sheet, sphere

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.io import find_seams, load_mesh, save_mesh
from riemhuman.surfaces import is_closed


def cut(faces, is_other_side):
    """Return the original of every vertex, and triangles, of a mesh cut between two sides."""
    keys = faces * 2 + is_other_side[:, None]
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    return faces.ravel()[first], inverse.reshape(-1, 3)


@pytest.fixture(scope="module")
def waist(bodies):
    faces = bodies.template.faces
    return cut(faces, bodies[20][faces].mean(axis=1)[:, 1] > 1.0)


def test_a_cut_body_is_joined_and_split_again(bodies, waist):
    source, faces = waist
    points = bodies.points[:5, source]
    seams = find_seams(points, faces)
    assert seams
    assert seams.n_copies == len(source) - bodies.template.n_vertices
    assert is_closed(seams.faces)
    np.testing.assert_array_equal(seams.split(seams.join(points)), points)
    np.testing.assert_array_equal(seams.join(points)[:, seams.faces], points[:, faces])
    # Joined vertices keep the order in which they come first.
    assert np.all(np.diff(seams.originals) > 0)


def test_a_seam_within_one_piece_is_joined():
    # A sheet rolled into a tube, as texture maps cut limbs along.
    vertices, faces = sheet(13, 6, 2 * np.pi, 1.0)
    tube = np.column_stack([np.cos(vertices[:, 0]), np.sin(vertices[:, 0]), vertices[:, 1]])
    seams = find_seams(tube, faces)
    assert (len(seams.edge_pairs), seams.n_copies) == (5, 6)


def test_every_triangle_on_its_own_is_joined():
    vertices, faces = sphere(2)
    seams = find_seams(vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3))
    assert len(seams.originals) == len(vertices)
    assert is_closed(seams.faces)


def test_rounding_below_a_millimetre_is_no_gap(bodies, waist):
    source, faces = waist
    noise = np.random.default_rng(0).uniform(-5e-4, 5e-4, (3, len(source), 3))
    assert find_seams(bodies.points[:3, source] + noise, faces).n_copies == 22
    assert not find_seams(bodies.points[:3, source] + 10 * noise, faces)


def test_lips_that_open_in_one_surface_are_no_seam():
    vertices, faces = sheet(9, 9, 1.0, 1.0)
    vertices = np.asarray(vertices)
    above = vertices[faces].mean(axis=1)[:, 1] > 0.5
    lip = np.flatnonzero((vertices[:, 1] == 0.5) & (np.abs(vertices[:, 0] - 0.5) < 0.24))
    mouth = faces.copy()
    for copy, vertex in enumerate(lip, len(vertices)):
        mouth[above[:, None] & (faces == vertex)] = copy
    closed = np.concatenate([vertices, vertices[lip]])
    opened = closed.copy()
    opened[len(vertices) :, 2] += 0.05
    assert find_seams(closed, mouth).n_copies == len(lip) == 3
    assert not find_seams(np.stack([closed, opened]), mouth)


def test_what_touches_is_not_joined(bodies):
    # Two closed bodies in the same place: every vertex coincides, and no border does.
    points = np.concatenate([bodies[0], bodies[0]])
    faces = bodies.template.faces
    assert not find_seams(points, np.concatenate([faces, faces + len(bodies[0])]))
    # Two sheets that lie on each other run along their borders in one direction.
    vertices, triangles = sheet(4, 4, 1.0, 1.0)
    both = np.concatenate([triangles, triangles + len(vertices)])
    assert not find_seams(np.concatenate([vertices, vertices]), both)


def test_template_and_readers_join(bodies, waist, tmp_path):
    source, faces = waist
    for number in range(3):
        save_mesh(tmp_path / f"{number}.obj", bodies[number][source], faces)
    file = tmp_path / "0.obj"
    assert load_mesh(file)[0].shape == (len(source), 3)
    assert load_mesh(file, seams="join")[0].shape == (1202, 3)
    assert rh.Template.from_file(file, seams="join").n_vertices == 1202
    with pytest.raises(ArgumentError, match=r"seams must be one of 'join', 'keep'"):
        load_mesh(file, seams="yes")
    joined, seams = rh.Template(bodies[0][source], faces).join_seams(bodies.points[:, source])
    np.testing.assert_array_equal(joined.faces, seams.faces)
    # With a gap in one of the surfaces, only the rest of the seam is joined.
    opened = bodies.points[:2, source].copy()
    first = seams.edge_pairs[0, 0, 0]
    opened[1, first, 1] += 0.02
    partial, _ = rh.Template(bodies[0][source], faces).join_seams(opened)
    assert joined.n_vertices < partial.n_vertices < len(source)


def test_folders_are_joined_where_all_files_agree(bodies, waist, tmp_path):
    source, faces = waist
    for number in range(3):
        save_mesh(tmp_path / f"{number}.ply", bodies[number][source], faces)
    files = rh.datasets.find_meshes(tmp_path)
    meshes = rh.datasets.RegisteredMeshes(files)
    assert meshes[:].shape == (3, 1202, 3)
    np.testing.assert_array_equal(meshes.seams.split(meshes[1]), bodies[1][source])
    assert is_closed(meshes.faces)
    rows = [f"{number}.ply,anna,{number}" for number in range(3)]
    (tmp_path / "labels.csv").write_text("\n".join(["file,subject,pose", *rows]))
    kept = rh.datasets.load_bodies(tmp_path, seams="keep")
    assert kept.template.n_vertices == len(source)
    # A template that is given keeps its vertices.
    assert rh.datasets.RegisteredMeshes(files, kept.template)[:].shape == (3, len(source), 3)

    # In one more file the halves are apart: they are two parts of a body in all of them.
    apart = bodies[3][source]
    upper = np.zeros(len(source), dtype=bool)
    upper[faces[bodies[20][source][faces].mean(axis=1)[:, 1] > 1.0]] = True
    apart[upper, 1] += 0.1
    save_mesh(tmp_path / "3.ply", apart, faces)
    files = rh.datasets.find_meshes(tmp_path)
    assert rh.datasets.RegisteredMeshes(files)[:].shape == (4, len(source), 3)


@pytest.fixture(scope="module")
def spaces(bodies, waist):
    source, faces = waist
    whole = rh.AlignedSurfaces(rh.Template(bodies[20], bodies.template.faces))
    return rh.AlignedSurfaces(rh.Template(bodies[20][source], faces)), whole


@pytest.mark.parametrize(
    "metric",
    [rh.ElasticMetric, rh.SRNFMetric, rh.GeneralElasticMetric, rh.RotationMetric],
)
def test_distances_see_through_seams(bodies, waist, spaces, metric):
    source, _ = waist
    with_seam, without = map(metric, spaces)
    expected = without.dist(bodies[20], bodies[13])
    found = with_seam.dist(bodies[20][source], bodies[13][source])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_laplacians_see_through_seams(bodies, waist, spaces):
    source, faces = waist
    cut_body = rh.surfaces.spectrum(bodies[20][source], faces, 6)
    whole = rh.surfaces.spectrum(bodies[20], bodies.template.faces, 6)
    np.testing.assert_allclose(cut_body.eigenvalues, whole.eigenvalues, rtol=1e-9)
    np.testing.assert_allclose(cut_body.functions, whole.functions[:, source], atol=1e-8)
    np.testing.assert_allclose(cut_body.areas.sum(), whole.areas.sum())
    basis = rh.DeformationBasis.from_laplacian(spaces[0].template, 12)
    first = spaces[0].template.seams.first_copies
    np.testing.assert_array_equal(basis.vectors[:, first], basis.vectors)


def test_transfers_and_interpolated_paths_keep_seams_closed(bodies, waist, spaces):
    source, _ = waist
    transfer = rh.solvers.ShapeTransfer().solve
    found = transfer(spaces[0], *bodies.points[[20, 10, 23]][:, source])
    expected = transfer(spaces[1], *bodies.points[[20, 10, 23]])
    np.testing.assert_allclose(found, expected[source], atol=1e-9)
    ends = bodies.points[[20, 23]]
    path = rh.solvers.PoissonPath(4).solve(spaces[0].metric, *ends[:, source]).path
    expected = rh.solvers.PoissonPath(4).solve(spaces[1].metric, *ends).path
    np.testing.assert_allclose(path, expected[:, source], atol=1e-9)


def _moves_all_vertices(metric, start, end):
    space, pose = metric.space, rh.ElasticMetric(metric.space, 0.0, 0.0, 1.0)
    solvers = rh.solvers
    return {
        "path": lambda: solvers.PathStraightening(3, max_iter=1).solve(metric, start, end),
        "mean": lambda: solvers.BasisMean(max_iter=1).solve(metric, np.stack([start, end])),
        "disentangling": lambda: solvers.Disentangling(max_iter=1).solve(metric, pose, start, end),
        "exponential": lambda: solvers.DiscreteExponential(n_steps=1, n_doublings=0).solve(
            metric, 0.01 * (end - start), start
        ),
        "surface": lambda: solvers.NearestSurface(max_iter=1).solve(
            metric, metric.map(np.stack([end])), start
        ),
        "random basis": lambda: solvers.BasisPath(
            rh.DeformationBasis(
                np.random.default_rng(0).normal(size=(3, *space.shape)), orthonormalize=True
            ),
            3,
            max_iter=1,
        ).solve(metric, start, end),
    }


@pytest.mark.filterwarnings("ignore::riemhuman.ConvergenceWarning")
@pytest.mark.parametrize(
    "name", ["path", "mean", "disentangling", "exponential", "surface", "random basis"]
)
def test_solvers_warn_before_they_tear_a_seam(bodies, waist, spaces, name):
    source, _ = waist
    start, end = bodies.points[[20, 23]]
    with pytest.warns(rh.SeamWarning, match=r"22 duplicated vertices .* template.join_seams\(\)"):
        _moves_all_vertices(rh.ElasticMetric(spaces[0]), start[source], end[source])[name]()


def test_registration_and_terms_at_vertices_refuse_seams(spaces):
    for make, reason in (
        (lambda: rh.SobolevMetric(spaces[0], a2=1.0), "second derivatives"),
        (lambda: rh.registration.TemplateRegistration(spaces[0].template), "it would tear"),
        (lambda: rh.GaugeInvariantMetric(rh.ElasticMetric(spaces[0])), "normals of vertices"),
    ):
        with pytest.raises(ArgumentError, match=rf"{reason}.*template\.join_seams"):
            make()

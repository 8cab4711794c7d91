"""One function views whatever it is given."""

import numpy as np
import pytest
from cases import sphere_template, surfaces

import riemhuman as rh
from riemhuman.errors import ArgumentError


def shown_surfaces(viewer):
    """Return the surfaces of all bodies of a view, one array a body."""
    return [body.frames for choice in viewer.choices.values() for body in choice]


def test_arrays_need_faces(bodies):
    (shown,) = shown_surfaces(rh.view(bodies[0], bodies.template.faces))
    assert np.array_equal(shown[0], bodies[0])
    with pytest.raises(ArgumentError, match="pass faces too"):
        rh.view(bodies.points[0])


def test_the_first_ten_of_many_bodies(bodies):
    viewer = rh.view(bodies)
    assert len(shown_surfaces(viewer)) == 10
    assert viewer.title == "10 of 100 bodies"


def test_motions_play_in_seconds():
    motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    viewer = rh.view(motion)
    assert viewer.frames_per_second == motion.frames_per_second
    (shown,) = shown_surfaces(viewer)
    assert len(shown) == len(motion)


def test_paths_and_means_of_solvers(bodies):
    space = rh.AlignedSurfaces(bodies.template)
    path = rh.solvers.LinearPath(n_nodes=4).solve(rh.ElasticMetric(space), bodies[0], bodies[1])
    (shown,) = shown_surfaces(rh.view(path, bodies.template.faces))
    np.testing.assert_array_equal(shown, rh.plots.on_the_ground(path.path))
    with pytest.raises(ArgumentError, match="path holds no triangles"):
        rh.view(path)


def test_templates_models_and_files(bodies, tmp_path):
    (shown,) = shown_surfaces(rh.view(bodies.template))
    assert np.array_equal(shown[0], bodies.template.vertices)
    assert len(shown_surfaces(rh.view(bodies.model))) == 1
    rh.save_mesh(tmp_path / "anna.ply", bodies[0], bodies.template.faces)
    viewer = rh.view(tmp_path / "anna.ply")
    assert viewer.title == "anna.ply"
    motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    motion.save(tmp_path / "knees.npz")
    assert rh.view(str(tmp_path / "knees.npz")).frames_per_second == pytest.approx(60.0)


def test_components_get_sliders():
    template = sphere_template()
    space = rh.AlignedSurfaces(template, equip=False)
    space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
    pca = rh.TangentPCA(space, n_components=1).fit(surfaces(template, 3, size=0.1))
    (body,) = next(iter(rh.view(pca).choices.values()))
    assert body.components is not None


def test_registered_scans_say_whether_they_are_trusted(bodies):
    registration = rh.registration.TemplateRegistration(bodies.template)
    result = registration.solve((bodies[0], bodies.template.faces), start=bodies[0])
    assert "not trusted" not in rh.view(result).title

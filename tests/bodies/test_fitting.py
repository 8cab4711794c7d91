"""Fits of body models: truths recovered, derivatives against autograd, maps, priors."""

import autograd
import autograd.numpy as anp
import numpy as np
import pytest
from model_pickles import smpl_fields
from open_bodies import model_with
from scipy import sparse
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, ModelFit, correspondence_matrix
from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.errors import ArgumentError, ConvergenceWarning


@pytest.fixture(scope="module")
def smpl():
    """Return a made-up model with pose-dependent displacements."""
    fields = smpl_fields(n_vertices=120)
    fields["faces"], fields["joint_regressor"] = fields.pop("f"), fields.pop("J_regressor")
    return BodyModel(**fields)


def parameters(model, n, rng=0, turn=0.6):
    rng = np.random.default_rng(rng)
    betas = rng.normal(size=(n, model.n_betas))
    return betas, turn * rng.normal(size=(n, model.n_joints, 3)), rng.normal(size=(n, 3))


def distances_mm(points, others):
    return 1000.0 * np.linalg.norm(points - others, axis=-1).mean(axis=-1)


def test_bodies_are_recovered(model):
    betas, pose, trans = parameters(model, 6)
    points = model(betas, pose, trans)
    fit = model.fit(points)
    assert isinstance(fit, ModelFit)
    assert fit.converged.all()
    surfaces = model(fit.betas, fit.pose, fit.trans)
    assert distances_mm(surfaces, points).max() < 1e-3
    gaps = np.linalg.norm(surfaces - points, axis=-1)
    np.testing.assert_allclose(fit.distances, gaps, rtol=0, atol=1e-12)
    np.testing.assert_allclose(1e3 * fit.mean_distance, distances_mm(surfaces, points), atol=1e-9)
    np.testing.assert_allclose(fit.betas, betas, atol=1e-4)
    np.testing.assert_allclose(fit.trans, trans, atol=1e-5)
    turns, found = (Rotation.from_rotvec(vectors.reshape(-1, 3)) for vectors in (pose, fit.pose))
    # Toes of the coarse model hang on few vertices, and so are the least certain.
    assert (turns.inv() * found).magnitude().max() < 1e-3
    assert np.linalg.norm(fit.pose, axis=-1).max() <= np.pi + 1e-12


def test_any_heading_and_place(model):
    betas, pose, _ = parameters(model, 2, rng=1)
    pose[:, 0] = Rotation.random(2, random_state=2).as_rotvec()
    trans = 1e3 * np.random.default_rng(3).normal(size=(2, 3))
    points = model(betas, pose, trans)
    fit = model.fit(points)
    assert fit.converged.all()
    assert fit.mean_distance.max() < 1e-6


def test_pose_dependent_displacements_where_the_root_is_the_last_joint():
    fields = smpl_fields(n_vertices=120)
    fields["faces"], regressor = fields.pop("f"), fields.pop("J_regressor")
    fields |= {"joint_regressor": regressor[::-1], "weights": fields["weights"][:, ::-1]}
    fields["kintree_table"] = fields["kintree_table"][:, ::-1]
    model = BodyModel(**fields)
    assert model.parents[-1] == -1
    betas, pose, trans = parameters(model, 3, rng=6, turn=0.4)
    fit = model.fit(model(betas, pose, trans))
    assert fit.converged.all()
    assert fit.mean_distance.max() < 1e-6


def test_leading_axes_and_single_surfaces(model):
    betas, pose, trans = parameters(model, 4, rng=7)
    points = model(betas, pose, trans).reshape(4, 1, -1, 3)
    before = points.copy()
    fit = model.fit(points)
    np.testing.assert_array_equal(points, before)
    assert fit.betas.shape == (4, 1, model.n_betas)
    assert fit.pose.shape == (4, 1, model.n_joints, 3)
    assert fit.trans.shape == (4, 1, 3)
    assert fit.distances.shape == (4, 1, model.n_vertices)
    assert fit.converged.shape == fit.n_iterations.shape == fit.mean_distance.shape == (4, 1)
    one = model.fit(points[2, 0])
    assert one.betas.shape == (model.n_betas,)
    assert one.converged.shape == ()
    for name in ("betas", "pose", "trans"):
        np.testing.assert_allclose(getattr(one, name), getattr(fit, name)[2, 0], atol=1e-12)
    assert fit.hands is None
    empty = model.fit(points[:0])
    assert empty.pose.shape == (0, 1, model.n_joints, 3)


def _on_triangles(model, n_points, rng):
    triangles = rng.integers(len(model.faces), size=n_points)
    return triangles, rng.dirichlet([1.0, 1.0, 1.0], size=n_points)


@pytest.mark.parametrize(("which", "mapped"), [("pose-dependent", True), ("open", False)])
def test_the_cost_of_a_fit_has_no_gradient(model, smpl, which, mapped):
    """By autograd through the model itself: misfit of weighted points, and priors."""
    body, rng = model if which == "open" else smpl, np.random.default_rng(22)
    chosen = _on_triangles(body, 600, rng) if mapped else None
    combine = correspondence_matrix(body, chosen).toarray()
    hands = [model.hand_pose("fist", "open")] if which == "open" else []
    target = combine @ body(*(values[0] for values in parameters(body, 1, rng=22)), *hands)
    target = target + 0.005 * rng.normal(size=target.shape)
    shares = rng.uniform(size=len(target))
    shares /= shares.sum()
    priors = {"betas_prior": 1e-5} | ({"hands_prior": 1e-6} if hands else {})
    settings = {"weights": shares, "tolerance": 1e-15}
    fit = body.fit(target, correspondence=chosen, **priors, **settings, max_iter=500)
    assert fit.converged

    def cost(betas, pose, trans, *hands):
        points = anp.dot(combine, body(betas, pose, trans, *hands))
        gaps = anp.sum((points - target) ** 2, axis=-1)
        prior = 1e-5 * anp.sum(betas**2)
        return anp.sum(shares * gaps) + prior + sum(1e-6 * anp.sum(values**2) for values in hands)

    found = [fit.betas, fit.pose, fit.trans, fit.hands][: 3 + len(hands)]
    for argument in range(len(found)):
        gradient = autograd.grad(cost, argument)(*found)
        np.testing.assert_allclose(gradient, 0.0, atol=1e-8)


def test_hands_are_recovered(model, smpl):
    hands = np.stack([model.hand_pose("fist", "relaxed"), model.hand_pose("open", "fist")])
    points = model(*parameters(model, 2, rng=26), hands)
    fit = model.fit(points, hands_prior=0.0)
    assert fit.converged.all()
    assert fit.mean_distance.max() < 1e-6
    np.testing.assert_allclose(fit.hands, hands, atol=1e-3)
    assert model.fit(points).mean_distance.min() > 1e-3
    with pytest.raises(ArgumentError, match="the model has no hand poses"):
        smpl.fit(smpl(), hands_prior=0.0)


def test_one_warning_about_fits_that_have_not_converged(model):
    points = model(*parameters(model, 3, rng=23))
    points = points + 0.02 * np.random.default_rng(24).normal(size=points.shape)
    with pytest.warns(ConvergenceWarning, match="3 of 3 fits, the first of surface 0") as caught:
        fit = model.fit(points, max_iter=1)
    assert len(caught) == 1
    assert caught[0].filename == __file__  # the line that called the fit
    assert not fit.converged.any()
    assert np.isfinite(fit.distances).all()


def test_a_joint_that_moves_nothing_stays(model):
    """One more joint, without vertices: its rotation is nobody's to tell."""
    n_vertices, n_joints = model.weights.shape
    lonely = model_with(
        model,
        joint_regressor=np.concatenate([model.joint_regressor, model.joint_regressor[:1]]),
        weights=np.concatenate([model.weights, np.zeros((n_vertices, 1))], axis=1),
        kintree_table=[[*model.parents, 3], range(n_joints + 1)],
        joint_names=None,
    )
    points = model(*parameters(model, 2, rng=25))
    fit = lonely.fit(points)
    assert fit.mean_distance.max() < 1e-6
    np.testing.assert_allclose(fit.pose[:, -1], 0.0, atol=1e-12)


BAD = {
    "another number of points": (
        {"points": np.zeros((7, 3))},
        r"points must have one point for each of the model's vertices, 1202; found \(7, 3\)",
    ),
    "no such vertex": (
        {"correspondence": np.arange(1, 1203)},
        "correspondence must hold whole numbers from 0 to 1201; found 1 to 1202",
    ),
    "no such triangle": (
        {"correspondence": ([2400], [[1, 0, 0]])},
        "triangles of correspondence must hold whole numbers from 0 to 2399; found 2400 to 2400",
    ),
    "coordinates off one": (
        {"correspondence": ([0, 1], [[1, 0, 0], [0.5, 0.2, 0.2]])},
        r"correspondence must have rows that sum to one; row 1 sums to 0\.9",
    ),
    "a matrix of another width": (
        {"correspondence": sparse.eye_array(7)},
        r"correspondence must have shape \(n_points, 1202\); found \(7, 7\)",
    ),
    "negative weights": ({"weights": np.full(1202, -1.0)}, "weights must be at least 0"),
}


@pytest.mark.everyday
@pytest.mark.parametrize("case", BAD)
def test_bad_arguments(model, case):
    arguments, message = BAD[case]
    with pytest.raises(ArgumentError, match=message):
        model.fit(**({"points": model()} | arguments))


def test_correspondences(model):
    for numbers in ([3, 7], [5, 5, 0, 1201], (9,), np.array([1, 0], np.uint16)):
        matrix = correspondence_matrix(model, numbers)
        np.testing.assert_array_equal(matrix @ model(), model()[np.asarray(numbers)])
    rows, columns = [0, 0, 1, 1], [4, 9, 2, 2]
    matrix = sparse.coo_array(([0.25, 0.75, 0.5, 0.5], (rows, columns)), shape=(2, 1202))
    expected = [0.25 * model()[4] + 0.75 * model()[9], model()[2]]
    for layout in ("csr", "dok"):
        found = correspondence_matrix(model, matrix.asformat(layout)) @ model()
        np.testing.assert_allclose(found, expected, atol=1e-15)


def test_moments_of_a_motion_start_from_the_one_before():
    model = load_open_model("coarse")
    motion, *_ = load_open_motions("coarse", sequences=["knees"])
    points = np.stack([motion[frame] for frame in range(6)])
    alone, together = model.fit(points), model.fit(points, sequence=True)
    np.testing.assert_allclose(together.pose, alone.pose, atol=1e-4)
    assert together.n_iterations[1:].sum() <= alone.n_iterations[1:].sum()

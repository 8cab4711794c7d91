"""The one registry of cases: spaces and metrics with points, and what is claimed of each.

Property tests run over all of `CASES`. What a metric can do, and which transformations leave its
distances alone, is declared here; a test never finds it out by catching an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import autograd.numpy as anp
import numpy as np
import trimesh

from riemhuman.geometry import (
    AlignedSurfaces,
    AreaMetric,
    EbinMetric,
    ElasticMetric,
    FlatMetric,
    GaugeInvariantMetric,
    GeneralElasticMetric,
    Manifold,
    MetricFields,
    NormalFieldMetric,
    NormalFields,
    ProductManifold,
    ProductMetric,
    PullbackMetric,
    RiemannianMetric,
    RotationFields,
    RotationMetric,
    SobolevMetric,
    SRNFMetric,
    VectorSpace,
)
from riemhuman.kernels.surface import square_root
from riemhuman.surfaces.template import Template

N_POINTS = 4


@cache
def sphere_template(subdivisions: int = 1) -> Template:
    """Return an icosphere of about human size, its triangles of unequal areas."""
    mesh = trimesh.creation.icosphere(subdivisions)
    return Template(np.asarray(mesh.vertices) * [0.5, 0.9, 0.4], np.asarray(mesh.faces))


@cache
def open_template() -> Template:
    """Return a piece of a plane, jittered, with a border."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(20)], axis=1)
    vertices += np.random.default_rng(5).uniform(-0.2, 0.2, vertices.shape)
    low = np.arange(20).reshape(4, 5)[:-1, :-1].ravel()
    faces = np.concatenate([[low, low + 1, low + 6], [low, low + 6, low + 5]], axis=1).T
    return Template(0.2 * vertices, faces)


@cache
def triangle_template() -> Template:
    """Return a single triangle, of no special shape."""
    return Template([[0.0, 0.0, 0.0], [0.7, 0.0, 0.1], [0.2, 0.9, -0.3]], [[0, 1, 2]])


TEMPLATES = {
    "sphere": sphere_template,
    "open": open_template,
    "triangle": triangle_template,
}


def surfaces(template: Template, n_samples: int, rng: int = 0, size: float = 0.3) -> np.ndarray:
    """Return the template under smooth deformations, shape (n_samples, V, 3)."""
    return template.vertices + deformations(template, n_samples, rng, size)


def deformations(template: Template, n_samples: int, rng: int = 0, size: float = 1.0) -> np.ndarray:
    """Return smooth deformation fields, linear and wavy, shape (n_samples, V, 3)."""
    rng = np.random.default_rng(rng)
    x = template.vertices
    linear = x @ rng.uniform(-1, 1, (n_samples, 3, 3))
    waves = rng.uniform(-4, 4, (n_samples, 3, 3))
    wavy = 0.25 * np.sin(x @ waves + rng.uniform(0, 6, (n_samples, 1, 3)))
    return size * (linear + wavy)


class HalfPlane(Manifold):
    """The upper half-plane y > 0, a manifold as a user of the library would write it."""

    def __init__(self):
        super().__init__(2, (2,))

    def belongs(self, point, atol=1e-9):
        """Tell where y > 0."""
        if np.shape(point)[-1:] != (2,):
            return np.zeros(np.shape(point)[:-1], dtype=bool)
        return np.isfinite(point).all(axis=-1) & (np.asarray(point)[..., 1] > 0)

    def to_tangent(self, vector, base_point=None):
        """Return the vector itself."""
        return vector

    def random_point(self, n_samples=1, bound=1.0, rng=None):
        """Draw points around i."""
        noise = np.random.default_rng(rng).uniform(-0.5 * bound, 0.5 * bound, (n_samples, 2))
        points = np.array([0.0, 1.0]) + noise
        return points[0] if n_samples == 1 else points


class HyperbolicInnerProduct(RiemannianMetric):
    """The hyperbolic metric by its inner product alone."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        """Return ⟨a, b⟩/y²."""
        return anp.sum(tangent_vec_a * tangent_vec_b, axis=-1) / base_point[..., 1] ** 2


class HyperbolicDistance(RiemannianMetric):
    """The hyperbolic metric by its squared distance alone."""

    def squared_dist(self, point_a, point_b):
        """Return (2 arcsinh(‖a − b‖/(2 √(y_a y_b))))²."""
        gap = anp.sum((point_a - point_b) ** 2, axis=-1)
        half = square_root(gap / (4.0 * point_a[..., 1] * point_b[..., 1]))
        return (2.0 * anp.arcsinh(half)) ** 2


def bend(points):
    """Return a map of the half-plane to the half-plane that is no isometry."""
    x, y = points[..., 0], points[..., 1]
    return anp.stack([x + 0.3 * y**2, y * anp.exp(0.2 * x)], axis=-1)


def edges_of_first_triangle(points):
    """Return two edge vectors of the first three vertices, reshaped as a metric-free field."""
    flat = anp.reshape(points[..., :3, :], (*points.shape[:-2], 9))
    return anp.reshape(flat[..., 3:] - flat[..., :6], (*points.shape[:-2], 2, 3))


CLOSED_FORM = frozenset({"dist", "geodesic", "exp", "log"})


@dataclass(frozen=True)
class Case:
    """A metric with points to try it on, what it can do and what it claims.

    Attributes
    ----------
    name : str
        Name of the test.
    metric : RiemannianMetric
        The metric; `metric.space` is its space.
    draw : callable
        Returns `points` and `tangent_vecs` when a test first asks for them.
    can : set of str
        What has a closed form: "dist", "geodesic", "exp", "log".
    invariant_under : set of str
        For surfaces: "translation" and "rotation" of one of two surfaces alone, "common rotation",
        "common reflection", "template" (another template with the same faces).
    """

    name: str
    metric: RiemannianMetric
    draw: Callable[[], tuple[np.ndarray, np.ndarray]]
    can: frozenset[str] = frozenset({"dist"})
    invariant_under: frozenset[str] = frozenset()

    @property
    def space(self) -> Manifold:
        """The space of the metric."""
        return self.metric.space

    @cached_property
    def _drawn(self) -> tuple[np.ndarray, np.ndarray]:
        return self.draw()

    @property
    def points(self) -> np.ndarray:
        """Four points, near enough for `log` to exist where it is declared."""
        return self._drawn[0]

    @property
    def tangent_vecs(self) -> np.ndarray:
        """Four tangent vectors, the k-th at the k-th point."""
        return self._drawn[1]


def surface_case(name, template, metric, *invariances, can=("dist",)):
    def draw():
        return surfaces(template, N_POINTS, rng=1), deformations(template, N_POINTS, rng=2)

    invariant_under = frozenset({"translation", "common rotation", *invariances})
    if not (isinstance(metric, RotationMetric) and metric.time > 0):  # mirror images are inside out
        invariant_under |= {"common reflection"}
    return Case(name, metric, draw, frozenset(can), invariant_under)


def sobolev_case(name, template_name, **weights):
    template = TEMPLATES[template_name]()
    metric = SobolevMetric(AlignedSurfaces(template, equip=False), **weights)
    case = surface_case(f"sobolev {name} {template_name}", template, metric, "template", can=())
    seen = {"translation"} if metric.a0 > 0 else set()
    return replace(case, invariant_under=case.invariant_under - seen)


def gauge_invariant_case(name, template_name, metric_class, *weights):
    template = TEMPLATES[template_name]()
    metric = GaugeInvariantMetric(metric_class(AlignedSurfaces(template, equip=False), *weights))
    case = surface_case(f"gauge-invariant {name} {template_name}", template, metric, can=())
    return replace(case, invariant_under=case.invariant_under - {"translation"})


def ebin_case(template_name, lam):
    space = MetricFields(TEMPLATES[template_name]())

    def draw():
        # θ between any two of the points stays below π.
        spread = min(1.0, 3.0 * np.sqrt(lam))
        center = space.random_point(rng=3)
        noise = space.to_tangent(np.random.default_rng(4).uniform(-1, 1, (4, *space.shape)), center)
        factor = np.linalg.cholesky(center)
        points = factor @ (np.eye(2) + 0.25 * spread * noise) @ np.swapaxes(factor, -1, -2)
        points *= np.random.default_rng(7).uniform(0.5, 2.0, (4, 1, 1, 1))
        return points, space.random_tangent_vec(points, rng=5)

    return Case(f"ebin {lam:g} {template_name}", EbinMetric(space, lam=lam), draw, CLOSED_FORM)


def field_case(name, space, metric=None):
    def draw():
        points = space.random_point(N_POINTS, rng=6)
        points = space.projection(0.5 * (points[0] + points))
        return points, space.random_tangent_vec(points, rng=7)

    return Case(name, metric or space.metric, draw, CLOSED_FORM)


def product_case(name, weights):
    template = sphere_template()
    ebin = MetricFields(template).equip_with_metric(EbinMetric, lam=2.0)
    space = ProductManifold([ebin, NormalFields(template)])
    return field_case(name, space, ProductMetric(space, weights))


def general_fields_case():
    metric = GeneralElasticMetric(AlignedSurfaces(open_template()), 1.0, 0.7, 2.0)
    fields = metric.target_metric.space.factors[0]
    return field_case("general fields", fields)


def half_plane_case(name, metric_class, *can):
    space = HalfPlane()

    def draw():
        points = space.random_point(N_POINTS, rng=8)
        return points, np.random.default_rng(9).standard_normal(points.shape)

    return Case(name, metric_class(space), draw, frozenset(can))


def bent_half_plane(space):
    return PullbackMetric(space, HyperbolicDistance(HalfPlane()), bend)


def bent_inner_product(space):
    return PullbackMetric(space, HyperbolicInnerProduct(HalfPlane()), bend)


def edges_metric(space):
    target = VectorSpace((2, 3)).metric
    return PullbackMetric(space, target, edges_of_first_triangle)


def cases_on_fields() -> list[Case]:
    """Return the cases whose points are fields, or vectors."""
    weighted_vectors = VectorSpace((3, 2)).equip_with_metric(FlatMetric, weights=[1.0, 0.5, 2.0])
    return [
        *(ebin_case("sphere", lam) for lam in (1e-4, 0.05, 1.0, 10.0)),
        ebin_case("triangle", 0.5),
        field_case("normals sphere", NormalFields(sphere_template())),
        field_case("normals triangle", NormalFields(triangle_template())),
        field_case("rotations sphere", RotationFields(sphere_template())),
        field_case("rotations triangle", RotationFields(triangle_template())),
        field_case("flat", weighted_vectors),
        product_case("product", [2.0, 0.3]),
        product_case("product of one", [0.0, 1.5]),
        general_fields_case(),
    ]


def elastic_cases() -> list[Case]:
    """Return the cases of the elastic families."""
    cases = []
    elastic = {
        "shape": (1.0, 1e-4, 0.0),
        "stretch": (2.0, 0.05, 0.0),
        "pose": (0.0, 0.0, 1.0),
        "mixed": (1.0, 0.1, 0.1),
        "all": (1.0, 1.0, 1.0),
    }
    for name, (a, lam, c) in elastic.items():
        claims = ("rotation", "template") if c == 0 else ()
        for template_name in ("sphere",) if name == "shape" else ("sphere", "open", "triangle"):
            template = TEMPLATES[template_name]()
            metric = ElasticMetric(AlignedSurfaces(template, equip=False), a, lam, c)
            cases.append(surface_case(f"{name} {template_name}", template, metric, *claims))
    for template_name in ("sphere", "open", "triangle"):
        template = TEMPLATES[template_name]()
        metric = SRNFMetric(AlignedSurfaces(template))
        cases.append(surface_case(f"srnf {template_name}", template, metric, "template"))
    for template_name in ("sphere", "open", "triangle"):
        template = TEMPLATES[template_name]()
        metric = GeneralElasticMetric(AlignedSurfaces(template), 1.0, 0.3, 0.7)
        cases.append(surface_case(f"general {template_name}", template, metric, "template"))
    return cases


def other_surface_cases() -> list[Case]:
    """Return the cases of other metrics on surfaces."""
    cases = [
        sobolev_case("all", "sphere", a0=0.3, a1=0.7, b1=0.4, c1=1.1, d1=0.5, a2=0.02),
        sobolev_case("second", "open", a1=0.5, a2=0.01),
        sobolev_case("first", "triangle"),
        gauge_invariant_case("elastic", "sphere", ElasticMetric, 1.0, 0.1, 0.3),
        gauge_invariant_case("srnf", "open", SRNFMetric),
    ]
    for template_name, time in (("sphere", 0.0), ("triangle", 0.0), ("open", 0.02)):
        template = TEMPLATES[template_name]()
        metric = RotationMetric(AlignedSurfaces(template, equip=False), time)
        diffused = ", diffused" if time > 0 else ""
        cases.append(surface_case(f"rotation {template_name}{diffused}", template, metric))
    for template_name, time in (("sphere", 0.1), ("triangle", 0.1), ("open", 0.0)):
        template = TEMPLATES[template_name]()
        metric = AreaMetric(AlignedSurfaces(template, equip=False), time)
        smoothed = ", smoothed" if time > 0 else ""
        cases.append(surface_case(f"area {template_name}{smoothed}", template, metric, "rotation"))
    return cases


def cases_of_users() -> list[Case]:
    """Return the cases of metrics that users define."""
    edges = edges_metric(AlignedSurfaces(sphere_template()))
    return [
        surface_case("edges", sphere_template(), edges, "template"),
        half_plane_case("half-plane, inner product", HyperbolicInnerProduct),
        half_plane_case("half-plane, distance", HyperbolicDistance, "dist"),
        half_plane_case("half-plane, pulled back", bent_half_plane, "dist"),
        half_plane_case("half-plane, inner product pulled back", bent_inner_product),
    ]


def build_cases() -> list[Case]:
    """Return all cases."""
    return [*cases_on_fields(), *elastic_cases(), *other_surface_cases(), *cases_of_users()]


def product_of_a_triangle() -> ProductManifold:
    """Return the metric and normal fields on one triangle."""
    triangle = triangle_template()
    return ProductManifold([MetricFields(triangle), NormalFields(triangle)])


SPACES = {
    "metric fields": (MetricFields(sphere_template()), 240, (80, 2, 2), EbinMetric),
    "normal fields": (NormalFields(sphere_template()), 160, (80, 3), NormalFieldMetric),
    "vectors": (VectorSpace((80, 3)), 240, (80, 3), FlatMetric),
    "surfaces": (AlignedSurfaces(sphere_template()), 126, (42, 3), ElasticMetric),
    "product": (product_of_a_triangle(), 5, (7,), ProductMetric),
}
"""Spaces by name, with dimension, shape of a point and class of their default metric."""

CASES = {case.name: case for case in build_cases()}
"""All cases by name."""

NAMES_OF_KINDS = [
    *("ebin 0.05 sphere", "normals sphere", "rotations sphere", "flat", "product"),
    *("mixed open", "pose triangle", "srnf sphere", "general open", "rotation open, diffused"),
    "area sphere, smoothed",
    *("sobolev all sphere", "gauge-invariant srnf open", "edges", "half-plane, distance"),
    *("half-plane, inner product", "half-plane, pulled back"),
]
KINDS = [CASES[name] for name in NAMES_OF_KINDS]
"""A case of each class of metrics."""

SURFACES = [
    CASES[name]
    for name in (
        *("shape sphere", "stretch open", "pose open", "mixed sphere", "srnf open"),
        *("general sphere", "rotation sphere", "rotation open, diffused"),
        *("area sphere, smoothed", "area open"),
    )
]
"""A case of each family of metrics on surfaces with distances."""


def cases_that(*can: str) -> list[Case]:
    """Return the cases with these closed forms."""
    return [case for case in CASES.values() if case.can.issuperset(can)]


def surface_cases(*can: str) -> list[Case]:
    """Return the cases on aligned surfaces with these closed forms."""
    return [case for case in cases_that(*can) if isinstance(case.space, AlignedSurfaces)]


def name_of(case: Case) -> str:
    """Return the name of a case, for `ids=`."""
    return case.name

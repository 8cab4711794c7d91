"""The paper's family of elastic metrics on aligned surfaces."""

from __future__ import annotations

from riemhuman.checks import metric_weight
from riemhuman.errors import ArgumentError
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.geometry.template_surfaces import TemplateSurfaces
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.ebin import EbinTerm
from riemhuman.terms.normals import NormalTerm
from riemhuman.terms.term import Term


class ElasticMetric(SurfaceMetric):
    r"""The pull-back by Φ of a · (Ebin metric) + c · (metric of normal fields).

    .. math:: d(f_1, f_2)^2 = a\, d^\lambda(g_1, g_2)^2 + c\int_T d_{S^2}(n_1, n_2)^2\, dx

    Equations 3 to 5 of the paper. (a, λ, c) = (1, 1e-4, 0) tells who it is, (0, 0, 1) how they
    stand.

    Parameters
    ----------
    a : float
        Weight of the change of the first fundamental form, at least 0.
    lam : float
        λ, the weight of changes of area within it; above 0 unless a = 0, where it has no effect.
    c : float
        Weight of the change of the normals, at least 0.

    Raises
    ------
    ArgumentError
        If a weight is negative, or all are 0, or λ = 0 with a > 0: the metric would be degenerate.

    Notes
    -----
    Let κ be the largest coordinate divided by the least height of a triangle, the template's
    included, and ε = 2.2e-16. Rounding in double precision changes a distance by at most 4εκ times
    the distance that a surface covers when all its triangles change by their own size. It changes
    inner products of deformations that move no vertex by more than a height by at most 4εκ times
    their norms. For slivers of aspect ratio 1e6 this bound is 1e-9; the largest error found was
    1e-11. Nearly equal surfaces, flat folds, antipodal normals and λ from 1e-8 to 1e4 add nothing.
    The entries of g are not used: computed from them, as by `AlignedSurfaces.metric_field`, errors
    would grow with κ².

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    >>> same_pose, same_person = bodies[13], bodies[4]
    >>> bool(pose.dist(bodies[3], same_pose) < pose.dist(bodies[3], same_person))
    True
    """

    def __init__(
        self,
        space: TemplateSurfaces,
        a: float = 1.0,
        lam: float = 1e-4,
        c: float = 0.0,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        self._a = metric_weight(a, "a")
        self._lam = metric_weight(lam, "lam")
        self._c = metric_weight(c, "c")
        if self._a == self._c == 0:
            raise ArgumentError("a and c must not both be 0: every distance would be 0")
        if self._a > 0 and self._lam == 0:
            raise ArgumentError(
                "lam must be above 0 where a > 0 (found lam = 0): the Ebin metric would be "
                "degenerate; the normals alone are (a, lam, c) = (0, 0, 1)"
            )
        terms: list[Term] = []
        if self._a > 0:
            terms.append(EbinTerm(self._a, self._lam))
        if self._c > 0:
            terms.append(NormalTerm(self._c))
        super().__init__(
            space,
            terms,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
            transport_solver=transport_solver,
        )

    @property
    def unseen_part(self) -> ElasticMetric | None:
        """The part of the family that the metric lacks: (1, 1, 0) if a = 0, (0, 0, 1) if c = 0."""
        if self._a > 0 and self._c > 0:
            return None
        if self._a == 0:
            return ElasticMetric(self.space, a=1.0, lam=1.0, c=0.0)
        return ElasticMetric(self.space, a=0.0, lam=0.0, c=1.0)

    def seeing_lengths(self, weight: float) -> ElasticMetric:
        """Return a metric that sees lengths as well: the metric itself unless a = 0.

        Parameters
        ----------
        weight : float
            Weight above 0 of (1, 1, 0) beside (0, 0, 1).

        Returns
        -------
        ElasticMetric
        """
        if self._a > 0:
            return self
        return ElasticMetric(self.space, a=weight * self._c, lam=1.0, c=self._c)

    @property
    def a(self) -> float:
        """The weight of the Ebin metric."""
        return self._a

    @property
    def lam(self) -> float:
        """The weight λ of the change of area in the Ebin metric."""
        return self._lam

    @property
    def c(self) -> float:
        """The weight of the metric of normal fields."""
        return self._c

"""Public names of riemhuman: what `__init__.py` loads when it is used, and what editors know."""

from . import (
    bodies as bodies,
    datasets as datasets,
    descriptors as descriptors,
    errors as errors,
    extensions as extensions,
    geometry as geometry,
    io as io,
    kernels as kernels,
    learned as learned,
    measurements as measurements,
    motions as motions,
    plots as plots,
    registration as registration,
    report as report,
    retrieval as retrieval,
    solvers as solvers,
    statistics as statistics,
    surfaces as surfaces,
    terms as terms,
    testing as testing,
    topologies as topologies,
)
from .bodies.body_model import BodyModel as BodyModel
from .errors import (
    ConvergenceWarning as ConvergenceWarning,
    MixedPosesWarning as MixedPosesWarning,
    PrecisionWarning as PrecisionWarning,
    RiemhumanError as RiemhumanError,
    SeamWarning as SeamWarning,
)
from .geometry.aligned_surfaces import AlignedSurfaces as AlignedSurfaces
from .geometry.fields import (
    EbinMetric as EbinMetric,
    MetricFields as MetricFields,
    NormalFieldMetric as NormalFieldMetric,
    NormalFields as NormalFields,
    RotationFieldMetric as RotationFieldMetric,
    RotationFields as RotationFields,
)
from .geometry.manifold import Manifold as Manifold
from .geometry.metric import RiemannianMetric as RiemannianMetric
from .geometry.product import (
    ProductManifold as ProductManifold,
    ProductMetric as ProductMetric,
    PullbackMetric as PullbackMetric,
)
from .geometry.smoothed_metrics import AreaMetric as AreaMetric, RotationMetric as RotationMetric
from .geometry.sobolev_metric import (
    GaugeInvariantMetric as GaugeInvariantMetric,
    SobolevMetric as SobolevMetric,
)
from .geometry.surface_metric import (
    ElasticMetric as ElasticMetric,
    GeneralElasticMetric as GeneralElasticMetric,
    SRNFMetric as SRNFMetric,
    SurfaceMetric as SurfaceMetric,
)
from .geometry.vector_space import FlatMetric as FlatMetric, VectorSpace as VectorSpace
from .io import save_glb as save_glb
from .io.meshes import load_mesh as load_mesh, save_mesh as save_mesh
from .plots.views import view as view
from .retrieval.jobs import pairwise_job as pairwise_job, path_job as path_job
from .retrieval.neighbors import NearestNeighbors as NearestNeighbors
from .solvers.geodesic_regression import GeodesicRegression as GeodesicRegression
from .solvers.means import FrechetMean as FrechetMean, GeometricMedian as GeometricMedian
from .solvers.tangent_pca import TangentPCA as TangentPCA
from .statistics.learned_metric import LearnedMetric as LearnedMetric
from .statistics.person_metric import PersonMetric as PersonMetric
from .surfaces.deformation_basis import DeformationBasis as DeformationBasis
from .surfaces.procrustes import (
    generalized_procrustes as generalized_procrustes,
    procrustes as procrustes,
)
from .surfaces.template import Template as Template

__version__: str

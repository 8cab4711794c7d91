"""Public names of `riemhuman.plots`."""

from .body_plots import (
    Contributions as Contributions,
    contributions as contributions,
    per_area as per_area,
    plot_body as plot_body,
    plot_path as plot_path,
)
from .component_views import view_components as view_components
from .difference_views import (
    plot_difference as plot_difference,
    view_difference as view_difference,
)
from .figures import figure_style as figure_style
from .map_views import view_map as view_map
from .maps import (
    describe_stress as describe_stress,
    embed as embed,
    plot_embedding as plot_embedding,
    stress as stress,
)
from .match_plots import plot_match as plot_match
from .measurement_views import (
    plot_measurements as plot_measurements,
    view_measurements as view_measurements,
)
from .motion_views import view_motions as view_motions
from .rendering import (
    render as render,
    surfaces_html as surfaces_html,
)
from .result_plots import (
    plot_confusion as plot_confusion,
    plot_energy as plot_energy,
    plot_precision_recall as plot_precision_recall,
    plot_sweep as plot_sweep,
)
from .scan_views import (
    plot_scan as plot_scan,
    view_scan as view_scan,
)
from .standing import on_the_ground as on_the_ground
from .viewed_bodies import ViewedBody as ViewedBody
from .viewer import (
    Viewer as Viewer,
    view_bodies as view_bodies,
    view_path as view_path,
)
from .views import view as view
from .windows import View as View

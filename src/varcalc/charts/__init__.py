"""Pictures. The only module that imports matplotlib, and it knows no solver.

Every function takes records that were computed elsewhere and returns a
matplotlib ``Figure`` of its own: nothing is drawn on a screen, and no setting
of matplotlib is changed.
"""

from varcalc.charts.comparison import comparison_picture
from varcalc.charts.drawing import drawing_picture
from varcalc.charts.motion import beside_picture, course_picture, motion_picture
from varcalc.charts.picture import picture
from varcalc.charts.rays import range_picture, rays_picture
from varcalc.charts.spread import convergence_picture, work_precision_picture
from varcalc.charts.themed_svg import themed_svg
from varcalc.charts.work_precision import claims_picture, cold_picture

__all__ = [
    "beside_picture",
    "claims_picture",
    "cold_picture",
    "comparison_picture",
    "convergence_picture",
    "course_picture",
    "drawing_picture",
    "motion_picture",
    "picture",
    "range_picture",
    "rays_picture",
    "themed_svg",
    "work_precision_picture",
]

"""Settings by which a scan is prepared."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import (
    check_amounts,
    check_cosines,
    check_counts,
    check_lists,
    check_shares,
)


@dataclass(frozen=True)
class PreparationSettings:
    """How a scan is reduced to evenly spread points with normals, without floor, walls and strays.

    Attributes
    ----------
    most_points : int
        Number of points of a scan that are kept; more would not improve a fit.
    first_points : int
        Number of points that are examined, chosen at random; more would only take time.
    long_edge : float
        Triangles with a longer edge are split, because only vertices are matched, metres.
    longest_edge : float
        Triangles with a longer edge are floors or strays and stay whole, metres.
    far_metres : float
        Points farther from the median are strays, metres.
    n_close : int
        The spacing of a point is the distance to this neighbour: on a surface, nearly every place
        is as near to some point of the scan.
    widest_spacing : float
        Largest width of the area that a point represents, metres.
    sparse_metres : float
        Only points with a larger spacing can be remnants of floors and stands, metres.
    sparse : float
        Remnants have a spacing of more than this multiple of the median over the area.
    few_sparse : float
        If such points represent a larger share of the area, they are part of a body that was
        sampled less densely.
    lonely_metres : float
        A point with a larger spacing belongs to no surface, metres.
    plane_metres : float
        Remnants of a floor lie within this distance of a common plane, metres.
    in_plane : float
        That plane holds at least this share of the sparse points.
    sparser : float
        Points with more than this multiple of the median spacing may be remnants of a floor.
    cell_metres : float
        Least width of the cells in which points are connected, metres.
    widest_cell : float
        Largest width of these cells, for sparse points, metres.
    cell_quantile : float
        The cells are as wide as the spacing at this quantile of the area.
    stray : float
        Separate parts with a smaller share of the area are strays.
    floor_metres : float
        Points within this distance of a plane support it, metres.
    near_floor_metres : float
        Points within this distance of a floor or wall belong to it, metres.
    same_way : float
        Cosine between normals of points of one floor or wall, of either sign.
    least_width : float
        Standard deviation of a floor's points in the narrower direction, metres.
    floor_share : float
        A floor or wall holds at least this share of the points.
    above_floor : float
        At least this share of the other points is on one side of the plane.
    n_planes : int
        Points whose tangent planes are tried as floors.
    most_planes : int
        Maximum number of planes: a floor and two walls.
    least_outside : float
        If a smaller share of a plane's points lies outside the outline of all others, the plane is
        a part of the body.
    outline_metres : float
        The outline is widened by this length, metres.
    least_resting : float
        A body rests on a plane if at least this share of its points is near it; a body does not
        rest on a wall next to it.
    resting_metres : float
        Distance that counts as near, metres.
    n_neighbours : int
        Neighbours from which normals are estimated or averaged.
    more_neighbours : tuple of int
        Larger numbers of neighbours, used if the first ones lie on a line, as along the rings of a
        scanner.
    on_line : float
        Neighbours lie on a line if their second-largest variance is a smaller share of the largest.
    normal_metres : float
        Distance that counts as much as a rotation of a normal by a radian in averages, metres.
    mixed : float
        A mesh has no consistent side if more of its edges join triangles that face different ways.
    least_level_floor : float
        Smallest cosine between a given up direction and a floor's normal; a plane that leans more
        is a wall.

    Examples
    --------
    >>> rh.registration.PreparationSettings().most_points
    20000
    """

    most_points: int = 20_000
    first_points: int = 80_000
    long_edge: float = 0.05
    longest_edge: float = 0.3
    far_metres: float = 10.0
    n_close: int = 6
    widest_spacing: float = 0.06
    sparse_metres: float = 0.03
    sparse: float = 3.0
    few_sparse: float = 0.03
    lonely_metres: float = 0.15
    plane_metres: float = 0.02
    in_plane: float = 0.4
    sparser: float = 1.5
    cell_metres: float = 0.05
    widest_cell: float = 0.12
    cell_quantile: float = 0.95
    stray: float = 0.004
    floor_metres: float = 0.01
    near_floor_metres: float = 0.02
    same_way: float = 0.9
    least_width: float = 0.2
    floor_share: float = 0.04
    above_floor: float = 0.97
    n_planes: int = 200
    most_planes: int = 3
    least_outside: float = 0.1
    outline_metres: float = 0.03
    least_resting: float = 0.004
    resting_metres: float = 0.07
    n_neighbours: int = 14
    more_neighbours: tuple[int, ...] = (40, 110)
    on_line: float = 0.15
    normal_metres: float = 0.03
    mixed: float = 0.05
    least_level_floor: float = 0.8

    def __post_init__(self) -> None:
        check_counts(
            most_points=self.most_points,
            first_points=self.first_points,
            n_close=self.n_close,
            n_planes=self.n_planes,
            most_planes=self.most_planes,
            n_neighbours=self.n_neighbours,
        )
        check_amounts(
            long_edge=self.long_edge,
            longest_edge=self.longest_edge,
            far_metres=self.far_metres,
            widest_spacing=self.widest_spacing,
            sparse_metres=self.sparse_metres,
            sparse=self.sparse,
            lonely_metres=self.lonely_metres,
            plane_metres=self.plane_metres,
            sparser=self.sparser,
            cell_metres=self.cell_metres,
            widest_cell=self.widest_cell,
            floor_metres=self.floor_metres,
            near_floor_metres=self.near_floor_metres,
            least_width=self.least_width,
            outline_metres=self.outline_metres,
            resting_metres=self.resting_metres,
            normal_metres=self.normal_metres,
        )
        check_shares(
            few_sparse=self.few_sparse,
            in_plane=self.in_plane,
            cell_quantile=self.cell_quantile,
            stray=self.stray,
            floor_share=self.floor_share,
            above_floor=self.above_floor,
            least_outside=self.least_outside,
            least_resting=self.least_resting,
            on_line=self.on_line,
            mixed=self.mixed,
        )
        check_lists(more_neighbours=self.more_neighbours)
        check_cosines(same_way=self.same_way, least_level_floor=self.least_level_floor)

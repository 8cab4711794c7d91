"""Draw a picture for each tutorial's card in the gallery: `python tutorials/thumbnails.py`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image, ImageDraw

import riemhuman as rh
from riemhuman.plots.figures import value_colors
from riemhuman.plots.windows import Window, window_around

FOLDER = Path(__file__).parent / "pictures" / "gallery"
WIDTH, HEIGHT = 480, 320  # pixels
SKIN, GOLD, BLUE = (0.80, 0.73, 0.66), (0.93, 0.74, 0.30), (0.45, 0.62, 0.78)
FRONT = rh.plots.View(azimuth=8.0, elevation=8.0)


def main() -> None:
    """Draw all thumbnails."""
    FOLDER.mkdir(exist_ok=True)
    bodies = rh.datasets.load_open_bodies()
    draw_distances_and_paths(bodies)
    draw_tables_and_transfers(bodies)
    draw_scans_and_measurements(bodies)
    draw_maps_and_other_surfaces(bodies)


def people_by_pose(bodies: rh.datasets.Bodies) -> tuple[np.ndarray, dict[str, int]]:
    """Return surfaces by person and pose, and the numbers of the poses by name."""
    people = bodies.points.reshape(10, 10, *bodies.points.shape[1:])
    return people, {name: number for number, name in enumerate(bodies.pose_names)}


def draw_distances_and_paths(bodies: rh.datasets.Bodies) -> None:
    """Draw the thumbnails of tutorials 1 to 5, and of 12."""
    people, pose = people_by_pose(bodies)
    faces = bodies.template.faces
    space = rh.AlignedSurfaces(bodies.template)
    elastic = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    motions = rh.datasets.load_open_motions(sequences=["punching", "knees"])
    basis = rh.DeformationBasis.from_motions(motions, n_components=60, step=5)

    # 1: how far apart are two bodies, and where?
    apart = [people[2, pose["t_like"]], people[2, pose["arms_up"]]]
    parts = rh.plots.contributions(elastic, *apart).total / bodies.template.face_areas
    painted = value_colors(parts, float(np.quantile(parts, 0.99)), signed=False)
    draw(1, apart, faces, [SKIN, painted])
    # 2: one person in two poses, and another in the same pose.
    hips, up = pose["hands_on_hips"], pose["arms_up"]
    trio = [people[2, up], people[2, hips], people[8, hips]]
    draw(2, trio, faces, [GOLD, GOLD, BLUE])
    # 3: a geodesic.
    search = rh.solvers.BasisPath(basis, n_nodes=4)
    ends = people[6, pose["squat"]], people[6, pose["hands_on_hips"]]
    draw(3, search.solve(elastic, *ends).path, faces, 4 * [SKIN])
    # 4: three people and their mean.
    space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1)
    some = people[[1, 4, 8], pose["hands_on_hips"]]
    mean = rh.FrechetMean(space, solver=rh.solvers.BasisMean(basis)).fit(some).estimate_
    draw(4, [*some, mean], faces, [*3 * [SKIN], GOLD])
    # 5: a term of one's own, the growth of triangles.
    growth = np.log(triangle_areas(people[8, 0], faces) / triangle_areas(people[1, 0], faces))
    limit = float(np.quantile(np.abs(growth), 0.99))
    draw(5, [people[1, 0], people[8, 0]], faces, [SKIN, value_colors(growth, limit, signed=True)])
    # 12: what three metrics see.
    draw_metrics(12, space, apart, faces)


def draw_tables_and_transfers(bodies: rh.datasets.Bodies) -> None:
    """Draw the thumbnails of tutorials 6 to 8."""
    people, pose = people_by_pose(bodies)
    faces = bodies.template.faces
    # 6: bodies of one's own, in any pose.
    draw(6, [people[k, p] for k, p in ((1, 1), (5, 6), (3, 9))], faces, 3 * [BLUE])
    # 7: all pairs of a hundred bodies.
    normals = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), a=0.0, lam=0.0, c=1.0)
    table = normals.dist_pairwise(bodies.points)
    order = np.argsort(bodies.pose, kind="stable")
    draw_table(7, table[np.ix_(order, order)])
    # 8: a movement transferred from one person to another.
    poses = pose["hands_on_hips"], pose["arms_up"]
    pairs = [people[person, number] for person in (2, 8) for number in poses]
    draw(8, pairs, faces, [SKIN, SKIN, SKIN, GOLD])


def draw_scans_and_measurements(bodies: rh.datasets.Bodies) -> None:
    """Draw the thumbnails of tutorials 9 to 11, and of 16."""
    people, pose = people_by_pose(bodies)
    faces = bodies.template.faces
    # 9: a scan and its body.
    seen = rh.registration.simulated_scan(
        bodies[57], faces, rng=3, n_points=12_000, missing=0.12, mesh=True, rotate=False
    )
    draw_scan(9, seen, bodies[57], faces)
    # 10: moments of a motion.
    knees = rh.datasets.load_open_motions(sequences=["knees"])[1]
    draw(10, [knees[k] for k in (4, 9, 14, 19)], faces, [*3 * [SKIN], GOLD])
    # 11: measurement lines.
    draw_lines(11, bodies)
    # 16: a body from a photograph.
    draw_photograph(16, people[4, pose["hands_on_hips"]], faces)


def draw_maps_and_other_surfaces(bodies: rh.datasets.Bodies) -> None:
    """Draw the thumbnails of tutorials 13 to 15."""
    space = rh.AlignedSurfaces(bodies.template)
    # 13: groups of people.
    draw_map(13, bodies, rh.ElasticMetric(space), "subject")
    # 14: surfaces that are not bodies.
    draw_sheets(14)
    # 15: a line between the codes of two bodies.
    draw_map(15, bodies, rh.RotationMetric(space), "pose")


def triangle_areas(surface: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the areas of the triangles."""
    a, b, c = (surface[corners] for corners in faces.T)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def window_of(points: np.ndarray, view: rh.plots.View) -> Window:
    """Return a window of the thumbnail's shape around points."""
    window = window_around(points, view, margin=0.1)
    height = max(window.height, window.width * HEIGHT / WIDTH)
    return replace(window, width=height * WIDTH / HEIGHT, height=height)


def beside_each_other(surfaces: Sequence[np.ndarray], gap: float = 0.12) -> list[np.ndarray]:
    """Return surfaces moved apart along x, all on one floor."""
    moved, end = [], 0.0
    for surface in surfaces:
        low, high = surface.min(axis=0), surface.max(axis=0)
        moved.append(surface + [end - low[0], -low[1], 0.0])
        end += high[0] - low[0] + gap
    return moved


def draw(number, surfaces, faces, colors, view=FRONT, *, ground=True, gap=0.12) -> None:
    """Draw surfaces beside each other, each in one colour or in one for each triangle."""
    moved = beside_each_other(list(surfaces), gap)
    shown = [(surface, faces, color) for surface, color in zip(moved, colors, strict=True)]
    write(number, picture_of(shown, view, ground=ground))


def picture_of(shown, view=FRONT, window=None, *, ground=True) -> Image.Image:
    """Return a picture of surfaces, each with its triangles and colours, on a clear ground."""
    if window is None:
        window = window_of(np.concatenate([points for points, _, _ in shown]), view)
    picture = Image.new("RGBA", (WIDTH, HEIGHT))
    for points, faces, color in shown:
        drawn = rh.plots.render(
            points, faces, height=HEIGHT, view=view, window=window, color=color, ground=ground
        )
        picture.alpha_composite(Image.fromarray(drawn).resize((WIDTH, HEIGHT)))
    return picture


def draw_table(number, table) -> None:
    """Draw a table of distances."""
    shares = table / table.max()
    painted = (255 * plt.get_cmap("cividis")(shares)[..., :3]).astype(np.uint8)
    square = Image.fromarray(painted).resize((HEIGHT - 20, HEIGHT - 20), Image.Resampling.NEAREST)
    canvas = Image.new("RGBA", (WIDTH, HEIGHT), "white")
    canvas.paste(square, ((WIDTH - square.width) // 2, 10))
    write(number, canvas)


def draw_scan(number, scan, body, faces) -> None:
    """Draw a scan beside the body that it shows."""
    left, right = beside_each_other([scan.points, body], gap=0.25)
    write(number, picture_of([(left, scan.faces, BLUE), (right, faces, SKIN)]))


def draw_lines(number, bodies) -> None:
    """Draw the girths of a body as bands."""
    names = [f"{part} girth" for part in ("chest", "waist", "hip", "thigh", "knee", "calf", "neck")]
    measurements = rh.measurements.Measurements(bodies.model, [*names, "upper arm girth"])
    model = bodies.model
    standing = measurements.definitions.standard_pose_vector
    surfaces = [model(bodies.betas[10 * person], standing) for person in (2, 8)]
    window = window_of(np.concatenate(beside_each_other(surfaces, gap=0.3)), FRONT)
    moved = beside_each_other(surfaces, gap=0.3)
    picture = picture_of([(surface, model.faces, SKIN) for surface in moved], FRONT, window)
    pen = ImageDraw.Draw(picture)
    for surface, place in zip(surfaces, moved, strict=True):
        shift = place[0] - surface[0]
        for pieces in measurements.lines(surface, axes="space").values():
            for piece in pieces:
                front = piece[piece[:, 2] >= piece[:, 2].mean()]
                ends = sorted(at(point + shift, window) for point in front)
                pen.line(ends, fill=(180, 40, 40, 255), width=2)
    write(number, picture)


def at(point, window) -> tuple[float, float]:
    """Return where a point is in the picture, seen from the front."""
    across, up, _ = FRONT.rotate(point)
    scale = HEIGHT / window.height
    x = (across - window.centre[0]) * scale + WIDTH / 2
    return x, HEIGHT / 2 - (up - window.centre[1]) * scale


def draw_metrics(number, space, pair, faces) -> None:
    """Draw what the normals, the areas and both tell of two poses."""
    metrics = [
        rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0),
        rh.ElasticMetric(space, a=1.0, lam=1e-4, c=0.0),
    ]
    colors = []
    for metric in metrics:
        density = rh.plots.contributions(metric, *pair).total / space.template.face_areas
        colors.append(value_colors(density, float(np.quantile(density, 0.98)), signed=False))
    draw(number, 3 * [pair[1]], faces, colors)


def draw_map(number, bodies, metric, label) -> None:
    """Draw a map of all bodies, with a colour for each class."""
    places = rh.plots.embed(metric, bodies)
    classes = getattr(bodies, label)
    figure, ax = plt.subplots(figsize=(4.8, 3.2), dpi=100)
    ax.scatter(*places.T, c=classes, cmap="tab10", s=26, linewidths=0)
    ax.set_axis_off()
    ax.margins(0.08)
    figure.subplots_adjust(0, 0, 1, 1)
    figure.canvas.draw()
    write(number, Image.fromarray(np.asarray(figure.canvas.buffer_rgba()).copy()))
    plt.close(figure)


def draw_sheets(number) -> None:
    """Draw a sheet bent in three ways."""
    u, v = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-0.8, 0.8, 60))
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (index[i, j].ravel() for i, j in CORNERS)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    sheets = []
    for curvature in (0.6, 1.5, 2.6):
        angle = curvature * u
        x, z = np.sin(angle) / curvature, (1 - np.cos(angle)) / curvature
        sheets.append(np.stack([x.ravel(), v.ravel(), -z.ravel()], axis=1))
    view = rh.plots.View(azimuth=35.0, elevation=25.0)
    draw(number, sheets, faces, [BLUE, SKIN, GOLD], view, ground=False, gap=0.5)


CORNERS = (
    (slice(None, -1), slice(None, -1)),
    (slice(None, -1), slice(1, None)),
    (slice(1, None), slice(1, None)),
    (slice(1, None), slice(None, -1)),
)


def draw_photograph(number, body, faces) -> None:
    """Draw a body in the frame of a photograph, and the same body outside of it."""
    left, right = beside_each_other([body, body], gap=0.5)
    picture = picture_of([(left, faces, (0.55, 0.57, 0.60)), (right, faces, SKIN)])
    canvas = Image.new("RGBA", (WIDTH, HEIGHT), "white")
    pen = ImageDraw.Draw(canvas)
    window = window_of(np.concatenate([left, right]), FRONT)
    first, last = (at(end, window)[0] for end in (left.min(axis=0), left.max(axis=0)))
    pen.rounded_rectangle(
        (first - 24, 8, last + 24, HEIGHT - 8),
        radius=10,
        fill=(226, 230, 234, 255),
        outline=(70, 75, 80, 255),
        width=4,
    )
    canvas.alpha_composite(picture)
    write(number, canvas)


def write(number: int, picture: Image.Image) -> None:
    """Write a thumbnail on white."""
    canvas = Image.new("RGBA", (WIDTH, HEIGHT), "white")
    canvas.alpha_composite(picture.convert("RGBA"))
    canvas.convert("RGB").quantize(128).save(FOLDER / f"{number}.png", optimize=True)
    print(f"gallery/{number}.png")


if __name__ == "__main__":
    main()

"""Draw the pictures of README.md and overview.md: `python tutorials/pictures.py`.

They go into tutorials/pictures. The picture of the report needs Chromium; without it, the picture
that is there stays.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image, ImageDraw

import riemhuman as rh
from riemhuman.plots.windows import window_around
from riemhuman.report.printing import find_browser

matplotlib.use("agg")

FOLDER = Path(__file__).parent / "pictures"
SKIN, GOLD = (0.80, 0.73, 0.66), (0.93, 0.74, 0.30)


def main() -> None:
    """Draw all pictures."""
    bodies = rh.datasets.load_open_bodies()
    space = rh.AlignedSurfaces(bodies.template)
    people = bodies.points.reshape(10, 10, *space.shape)
    geodesic(bodies, space)
    moving(bodies, space)
    maps(bodies, space)
    differences(bodies, people)
    path_and_mean(bodies, space, people)
    scan()
    measurement_lines(bodies)
    motions()
    report()
    sheet()


def geodesic(bodies, space) -> None:
    """Draw the straight path from arms up to bent elbows above the geodesic.

    Coloured by how far the areas of triangles leave the range of those at the end points.
    """
    motions = rh.datasets.load_open_motions(sequences=["chicken_wings", "shake_arms", "punching"])
    basis = rh.DeformationBasis.from_motions(motions, n_components=100)
    metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0)
    start, end = (
        bodies.points[20 + bodies.pose_names.index(p)] for p in ("arms_up", "bent_elbows")
    )
    paths = {
        "straight line": rh.solvers.LinearPath(7).solve(metric, start, end),
        "geodesic": rh.solvers.BasisPath(basis, n_nodes=7).solve(metric, start, end),
    }
    figure, axes = plt.subplots(2, 1, figsize=(13, 6.8), layout="constrained")
    for ax, (name, result) in zip(axes, paths.items(), strict=True):
        change = area_change(result.path, bodies.template.faces)
        rh.plots.plot_path(
            rh.plots.on_the_ground(result.path),
            bodies.template.faces,
            change,
            largest=0.5,
            label="area beyond its end values",
            ax=ax,
            spacing=1.3,
        )
        ax.set_title(
            f"{name}, energy {result.energy:.2f}: on the way, 99 % of the triangles' areas stay "
            f"within {100 * np.quantile(change, 0.99):.0f} % of the end values",
            fontsize=14,
        )
    save(figure, "geodesic", dpi=100)


def moving(bodies, space) -> None:
    """Draw the straight path and the geodesic of two people as an animation, there and back."""
    motions = rh.datasets.load_open_motions(sequences=["chicken_wings", "shake_arms", "punching"])
    basis = rh.DeformationBasis.from_motions(motions, n_components=100)
    metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0)
    start, end = (
        bodies.points[20 + bodies.pose_names.index(p)] for p in ("arms_up", "bent_elbows")
    )
    n_nodes = 13
    straight = rh.solvers.LinearPath(n_nodes).solve(metric, start, end).path
    geodesic = rh.solvers.BasisPath(basis, n_nodes=n_nodes).solve(metric, start, end).path
    faces = bodies.template.faces
    colors = [shrinking_colors(area_change(path, faces)) for path in (straight, geodesic)]
    straight, geodesic = map(rh.plots.on_the_ground, (straight, geodesic))
    middle = (start + end).mean(axis=0) / 2
    middle[2] = 0.0
    view = rh.plots.View(azimuth=0.0)
    window = window_around(np.concatenate([*straight, *geodesic]) - middle, view, margin=0.06)
    frames = []
    for number in range(n_nodes):
        halves = [
            rh.plots.render(
                path[number] - middle,
                faces,
                height=560,
                view=view,
                window=window,
                color=path_colors[number],
            )
            for path, path_colors in zip((straight, geodesic), colors, strict=True)
        ]
        picture = np.concatenate(halves, axis=1)
        canvas = Image.new("RGBA", (picture.shape[1], 600), "white")
        canvas.alpha_composite(Image.fromarray(picture), (0, 36))
        pen = ImageDraw.Draw(canvas)
        for place, text in ((0.25, "straight line: arms shrink"), (0.75, "geodesic: arms rotate")):
            pen.text((place * canvas.width, 6), text, "black", anchor="mt", font_size=24)
        frames.append(canvas.convert("RGB"))
    hold = [600, *[90] * (n_nodes - 2), 600]
    back_and_forth = [*range(n_nodes), *range(n_nodes - 2, 0, -1)]
    pictures = [frames[number].quantize(128, dither=Image.Dither.NONE) for number in back_and_forth]
    pictures[0].save(
        FOLDER / "moving.gif",
        save_all=True,
        append_images=pictures[1:],
        duration=[hold[number] for number in back_and_forth],
        loop=0,
    )


def shrinking_colors(change: np.ndarray) -> np.ndarray:
    """Return colours from skin to red for changes of area up to a half, (n_nodes, F, 3)."""
    share = np.clip(change / 0.5, 0.0, 1.0)[..., None]
    return (1.0 - share) * SKIN + share * np.array([0.75, 0.10, 0.10])


def area_change(path: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return by what share triangles leave the range of areas at the ends, shape (n_nodes, F)."""
    corners = path[:, faces]
    sides = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    areas = np.linalg.norm(sides, axis=-1) / 2
    smallest, largest = areas[[0, -1]].min(axis=0), areas[[0, -1]].max(axis=0)
    return np.maximum(np.maximum(areas / largest - 1, 1 - areas / smallest), 0.0)


def maps(bodies, space) -> None:
    """Draw the maps of all bodies by the shape metric and by the pose metric."""
    figure, axes = plt.subplots(1, 2, figsize=(12, 5.6), layout="constrained")
    tasks = {
        "who is it? (1, 0.0001, 0)": (rh.ElasticMetric(space), "subject"),
        "how do they stand? (0, 0, 1)": (rh.ElasticMetric(space, 0.0, 0.0, 1.0), "pose"),
    }
    for ax, (title, (metric, label)) in zip(axes, tasks.items(), strict=True):
        places = rh.plots.embed(metric, bodies)
        names = getattr(bodies, f"{label}_names")
        rh.plots.plot_embedding(
            places, getattr(bodies, label), names, ax=ax,
            points=bodies.points, faces=bodies.template.faces,
        )  # fmt: skip
        ax.set_title(title)
    save(figure, "maps")


def differences(bodies, people) -> None:
    """Draw two people in the standard pose, each coloured by where it lies outside the other."""
    names = ("lanky man", "heavy man")
    first, second = (bodies.subject_names.index(name) for name in names)
    figure = rh.plots.plot_difference(
        people[first, 0], people[second, 5], bodies.template.faces, names=names
    )
    figure.set_size_inches(7.4, 5)
    save(figure, "differences", dpi=100)


def path_and_mean(bodies, space, people) -> None:
    """Draw a geodesic between two poses, and the mean of three people."""
    motions = rh.datasets.load_open_motions(sequences=["punching", "knees", "hips"])
    basis = rh.DeformationBasis.from_motions(motions, n_components=100)
    metric = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1).metric
    faces = bodies.template.faces
    squat, hands = (bodies.pose_names.index(name) for name in ("squat", "hands_on_hips"))
    path = rh.solvers.BasisPath(basis, n_nodes=7).solve(metric, people[6, squat], people[6, hands])
    figure, ax = plt.subplots(figsize=(9, 2.5), layout="constrained")
    standing = rh.plots.on_the_ground(path.path)
    rh.plots.plot_path(standing, faces, ax=ax, spacing=1.15)
    save(figure, "path")

    some = people[[1, 4, 8], 0]
    mean = rh.FrechetMean(space, solver=rh.solvers.BasisMean(basis)).fit(some).estimate_
    figure, ax = plt.subplots(figsize=(9, 2.8), layout="constrained")
    colors = [SKIN, SKIN, SKIN, GOLD]
    rh.plots.plot_path([*some, mean], faces, colors=colors, ax=ax, spacing=1.7)
    save(figure, "mean")


def scan() -> None:
    """Draw a scan with holes, the body that is registered to it, and their distances."""
    bodies = rh.datasets.load_open_bodies("coarse")
    simulated = rh.registration.simulated_scan(
        bodies[57], bodies.template.faces, rng=3, n_points=12000, missing=0.12
    )
    result = rh.registration.ScanRegistration(bodies.model).solve(simulated.surface)
    figure = rh.plots.plot_scan(rh.registration.lay_over_body(result))
    save(figure, "scan", dpi=100)


def measurement_lines(bodies) -> None:
    """Draw a person in the standard pose with all girths, and their values."""
    every = rh.measurements.Measurements(bodies.model)
    girths = rh.measurements.Measurements(
        bodies.model, [name for name in every.names if "girth" in name]
    )
    save(rh.plots.plot_measurements(girths, bodies[25]), "measurement_lines", dpi=100)


def motions() -> None:
    """Draw two performances of one motion aligned in time, one above the other."""
    people = ["lean runner", "older heavy man"]
    recorded = rh.datasets.load_open_motions("coarse", people, ["knees"])
    # The second is slower.
    first = recorded[0][:60:2]
    second = recorded[1][:78:3]
    template = recorded[0].template
    space = rh.AlignedSurfaces(template).equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    warping = rh.motions.DynamicTimeWarping(space.metric, centered=True)
    curves = rh.motions.MotionSpace(space, n_times=9)
    rows = rh.motions.align_motions(curves, first, second, warping)[:2]
    figure, axes = plt.subplots(2, 1, figsize=(9, 3.8), layout="constrained")
    for ax, row, color in zip(axes, rows, (SKIN, GOLD), strict=True):
        rh.plots.plot_path(row, template.faces, colors=len(row) * [color], ax=ax, spacing=1.15)
    save(figure, "motions")


def report() -> None:
    """Take a picture of the top of the quick report's page."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        print("report.png is left as it is: no Chromium was found")
        return
    with tempfile.TemporaryDirectory() as folder:
        rh.report.make_report(Path(folder) / "report", quick=True)
        page = (Path(folder) / "report" / "index.html").as_uri()
        options = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--window-size=1200,900"]
        options += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        picture = FOLDER / "report.png"
        subprocess.run(
            [browser, *options, f"--screenshot={picture}", page], check=True, capture_output=True
        )
    print(picture.name)


def sheet() -> None:
    """Take a picture of the first side of a sheet."""
    model = rh.datasets.load_open_model()
    bodies = rh.datasets.load_open_bodies("coarse")
    person = bodies.subject == bodies.subject_names.index("athletic woman")
    angles = {"shoulder": ("xz", 10, -58), "elbow": ("y", -18), "hip": ("z", 5)}
    pose = rh.datasets.pose_vectors(rh.datasets.joint_rotations(angles, model), model)
    body = model(bodies.betas[person][0], pose)
    settings = {"n_points": 12_000, "mesh": True, "noise": 0.0015, "missing": 0.06}
    scan = rh.registration.simulated_scan(body, model.faces, rng=3, **settings)
    result = rh.registration.ScanRegistration(model).solve((scan.points, scan.faces))
    anna = rh.report.sheet(result, name="Anna", sex="woman")
    browser = find_browser()
    if browser is None:
        print("sheet.png is left as it is: no Chromium was found")
        return
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "sheet.html"
        anna.save(page)
        options = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--window-size=1040,1270"]
        picture = FOLDER / "sheet.png"
        subprocess.run(
            [browser, *options, f"--screenshot={picture}", page.as_uri()],
            check=True,
            capture_output=True,
        )
    Image.open(picture).quantize(128).save(picture, optimize=True)
    print(picture.name)


def save(figure, name: str, dpi: int = 80) -> None:
    """Write a figure into the folder of pictures."""
    figure.savefig(FOLDER / f"{name}.png", dpi=dpi)
    plt.close(figure)
    print(f"{name}.png")


if __name__ == "__main__":
    main()

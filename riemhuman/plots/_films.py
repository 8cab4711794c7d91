"""Moving pictures of bodies, drawn by the library's own renderer: GIF by Pillow, MP4 by PyAV."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from riemhuman.arrays import Array, Points, Triangles
from riemhuman.errors import ArgumentError
from riemhuman.io.files import write_bytes
from riemhuman.optional import import_optional
from riemhuman.plots._ground_picture import Ground
from riemhuman.plots.figures import written
from riemhuman.plots.rendering import render
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.windows import View, Window

FILM_ENDINGS = (".gif", ".mp4")

_HEIGHTS = {".gif": 400, ".mp4": 720}
_RATES = {".gif": 20, ".mp4": 30}  # pictures a second
_WIDEST = 1920
_TURN_SECONDS = 4.0  # in which still bodies turn once
_MOST_LOOKED_AT = 48  # number of a body's frames used to frame the picture
_MOST_BODIES = 8
_N_COLORS = 256  # of a GIF
_QUALITY = "18"  # of H.264: smaller is better; 18 is hard to tell from the original
_PAPER = 255  # white


@dataclass(frozen=True)
class Film:
    """Bodies side by side that move, or turn once.

    `seconds` is the duration; in recordings (`frames_per_second`) shorter bodies wait at the end.
    """

    bodies: Sequence[ViewedBody]
    faces: Triangles
    seconds: float
    frames_per_second: float | None

    @property
    def n_frames(self) -> int:
        """Frames that the longest body shows."""
        return max(body.n_times for body in self.bodies)

    def place(self, body: ViewedBody, share: float) -> float:
        """Return the frame at a share of the duration, or a place between two."""
        if body.times is not None:
            return float(np.interp(share * (body.n_times - 1), np.arange(body.n_times), body.times))
        if self.frames_per_second is not None:
            return min(share * (self.n_frames - 1), len(body.frames) - 1.0)
        return share * (len(body.frames) - 1)

    def surface(self, body: ViewedBody, share: float) -> Points:
        """Return the surface at a share of the duration."""
        place = self.place(body, share)
        number = int(np.floor(place))
        before, after = body.surface(number), body.surface(int(np.ceil(place)))
        surface: Points = before + (place - number) * (after - before)
        return surface

    def passed(self, body: ViewedBody, share: float) -> Array:
        """Return how far the ground has moved below a body, shape (2,)."""
        if body.track is None:
            return np.zeros(2)
        place, numbers = self.place(body, share), np.arange(len(body.track))
        return np.array([np.interp(place, numbers, body.track[:, axis]) for axis in range(2)])


def save_film(file: Path, film: Film, *, progress: bool) -> None:
    """Write a GIF or MP4 file."""
    ending = file.suffix.lower()
    if len(film.bodies) > _MOST_BODIES:
        raise ArgumentError(
            f"a film shows at most {_MOST_BODIES} bodies; found {len(film.bodies)}: "
            "save a page (.html) instead"
        )
    if ending == ".mp4":
        import_optional("av", "video")  # before anything is drawn
    rate = _RATES[ending]
    if film.n_frames > 1:
        n_pictures = round(film.seconds * rate) + 1  # both ends
    else:
        n_pictures = round(_TURN_SECONDS * rate)  # the last picture would be the first
    n_pictures = max(2, n_pictures)
    pictures = _pictures(film, _HEIGHTS[ending], n_pictures, rate)
    counted = iter(tqdm(pictures, desc=file.name, total=n_pictures, disable=not progress))
    write_bytes(file, _gif(counted, rate) if ending == ".gif" else _mp4(counted, rate))


def _pictures(film: Film, height: int, n_pictures: int, rate: int) -> Iterator[Image.Image]:
    """Draw all pictures, one after the other."""
    turns = film.n_frames == 1
    grounds = [Ground.below(_some_frames(body, turns), body.ground) for body in film.bodies]
    windows = _windows(film, grounds, turns)
    aspect = sum(window.width for window in windows) / windows[0].height
    height = 2 * (min(height, int(_WIDEST / aspect)) // 2)  # H.264 needs even numbers of pixels
    for number in range(n_pictures):
        view = View()
        share = number / max(n_pictures - 1, 1)
        if turns:
            view = View(azimuth=view.azimuth + 360 * number / n_pictures)
            share = 0.0
        parts = []
        for body, ground, window in zip(film.bodies, grounds, windows, strict=True):
            surface = film.surface(body, share)
            if turns:
                surface = surface - _middle(body)
            picture = render(
                surface,
                film.faces,
                height=height,
                view=view,
                window=window,
                color=body.colors(film.faces),
            )
            moved = replace(ground, passed=film.passed(body, share))
            parts.append(moved.under(picture, surface, view, window))
        time = f"{number / rate:.2f} s" if film.frames_per_second is not None else ""
        yield _on_paper(parts, [body.label for body in film.bodies], time)


def _some_frames(body: ViewedBody, turns: bool) -> list[Array]:
    """Return the frames used to frame the picture; a turning body is on its axis."""
    places = np.linspace(0, len(body.frames) - 1, min(len(body.frames), _MOST_LOOKED_AT))
    numbers = np.unique(places.round().astype(int))
    frames = [body.surface(number) for number in numbers.tolist()]
    return [frame - _middle(body) for frame in frames] if turns else frames


def _middle(body: ViewedBody) -> Array:
    """Return the axis that a body turns about, at the height of the ground."""
    surface = body.surface(0)
    middle: Points = (surface.min(axis=0) + surface.max(axis=0)) / 2
    middle[1] = 0.0
    return middle


def _windows(film: Film, grounds: Sequence[Ground], turns: bool) -> list[Window]:
    """Return a window of the same size for each body, which contains it at all times."""
    corners = []
    for body, ground in zip(film.bodies, grounds, strict=True):
        views = [View(azimuth=azimuth) for azimuth in range(0, 360, 15)] if turns else [View()]
        frames = _some_frames(body, turns)
        boxes = [ground.window(frames, view) for view in views]
        centres = np.array([box.centre for box in boxes])
        halves = np.array([(box.width, box.height) for box in boxes]) / 2
        corners.append(((centres - halves).min(axis=0), (centres + halves).max(axis=0)))
    width, height = np.max([high - low for low, high in corners], axis=0)
    # All bodies stand on one floor, above the line of names.
    names = 0.08 * height
    height += names
    windows = []
    for low, high in corners:
        x = (low[0] + high[0]) / 2
        y = low[1] - names + height / 2
        windows.append(Window((float(x), float(y)), float(width), float(height)))
    return windows


def _on_paper(parts: Sequence[Array], labels: Sequence[str], time: str) -> Image.Image:
    """Return pictures side by side on white, each with its label below, and the time."""
    row = np.concatenate(parts, axis=1)
    row = row[:, : 2 * (row.shape[1] // 2)]  # an even number of pixels, for H.264
    opacity = row[..., 3:] / 255
    flat = np.round(row[..., :3] * opacity + _PAPER * (1 - opacity)).astype(np.uint8)
    picture = Image.fromarray(flat)
    size = picture.height // 20
    left = 0
    for part, label in zip(parts, labels, strict=True):
        text = _text(label, size)
        middle = left + part.shape[1] // 2
        picture.paste(text, (middle - text.width // 2, picture.height - text.height - 2), text)
        left += part.shape[1]
    clock = _text(time, size)
    picture.paste(clock, (size // 2, size // 2), clock)
    return picture


@cache
def _text(text: str, size: int) -> Image.Image:
    return Image.fromarray(written(text, size))


def _gif(pictures: Iterator[Image.Image], rate: int) -> bytes:
    """Return a GIF file that loops; all pictures share one palette."""
    first = next(pictures)
    palette = first.quantize(_N_COLORS, dither=Image.Dither.NONE)
    following = (
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    )
    file = io.BytesIO()
    palette.save(
        file,
        format="GIF",
        save_all=True,
        append_images=following,
        duration=1000 // rate,
        loop=0,
        optimize=False,
    )
    return file.getvalue()


def _mp4(pictures: Iterator[Image.Image], rate: int) -> bytes:
    """Return an MP4 file with H.264, which browsers, slides and messengers play."""
    av = import_optional("av", "video")
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": _QUALITY})
        stream.pix_fmt = "yuv420p"
        for number, picture in enumerate(pictures):
            if not number:
                stream.width, stream.height = picture.size
            container.mux(stream.encode(av.VideoFrame.from_image(picture)))
        container.mux(stream.encode())
    return file.getvalue()

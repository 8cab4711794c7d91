"""Films of viewers: GIF and MP4 files, drawn by the library's own renderer."""

import io
import itertools
import sys

import numpy as np
import pytest
from open_bodies import coarse_bodies
from PIL import Image

import riemhuman as rh
from riemhuman.errors import ArgumentError, MissingDependencyError
from riemhuman.plots import ViewedBody, Viewer, view_bodies, view_path

BODIES = coarse_bodies()
FACES = BODIES.template.faces
KNEES = rh.datasets.load_open_motions("coarse", sequences="knees")[0]


def gif_frames(path):
    with Image.open(path) as film:
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
        return frames, film.info


@pytest.mark.slow
def test_a_body_that_does_not_move_turns_once(tmp_path):
    view_bodies(BODIES[0], FACES, ["Anna"]).save(tmp_path / "one.gif")
    frames, info = gif_frames(tmp_path / "one.gif")
    assert (len(frames), info["duration"], info["loop"]) == (80, 50, 0)
    # From the side a body is narrower than from the front; after half a turn it is as wide again.
    widths = [(frame[:300] < 235).all(axis=-1).any(axis=0).sum() for frame in frames]
    assert widths[15] < 0.85 * widths[75]
    assert widths[35] == pytest.approx(widths[75], abs=4)


@pytest.mark.slow
def test_recordings_keep_their_pace_and_the_shorter_one_waits(tmp_path):
    bodies = [ViewedBody("long", KNEES[:61]), ViewedBody("short", KNEES[:31])]
    Viewer(KNEES.faces, {"": bodies}, frames_per_second=60).save(tmp_path / "two.gif")
    frames, _ = gif_frames(tmp_path / "two.gif")
    assert len(frames) == 21
    half = frames[0].shape[1] // 2
    moved = [np.abs(a - b)[20:370] for a, b in itertools.pairwise(frames[12:])]
    assert min(change[:, : half - 5].max() for change in moved) > 10
    assert max(change[:, half + 5 :].max() for change in moved) == 0


@pytest.mark.slow
def test_mp4_holds_the_same_film(tmp_path):
    av = pytest.importorskip("av")
    view_path(BODIES[[0, 3]], FACES, seconds=0.5).save(tmp_path / "path.mp4")
    with av.open(io.BytesIO((tmp_path / "path.mp4").read_bytes())) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 30
        assert film.streams.video[0].codec_context.name == "h264"
    assert len(frames) == 16
    assert frames[0].shape[0] == 720
    assert (frames[0].min(axis=-1) < 220).mean() > 0.05


def test_refusals(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingDependencyError, match=r"\[video\]"):
        view_path(BODIES[[0, 3]], FACES).save(tmp_path / "path.mp4")
    assert not (tmp_path / "path.mp4").exists()
    with pytest.raises(ArgumentError, match="at most 8 bodies; found 9"):
        view_bodies(BODIES[:9], FACES).save(tmp_path / "nine.gif")

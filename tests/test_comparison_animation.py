"""The film of learned beside optimal: what is drawn are the records, and a file comes out."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib import animation as films
from PIL import Image
from stationkeep.comparison.report import animate
from stationkeep.comparison.report.animation import FRAMES_PER_SECOND, HULL, frames, outline
from stationkeep.symbolic import InputError


def runs() -> tuple[xr.Dataset, xr.Dataset]:
    """Return two made-up records of 4 s and 2 s: a straight way home at constant speed."""
    made = []
    for end in (4.0, 2.0):
        time = np.linspace(0.0, end, 41)
        zeta = np.outer(1.0 - time / end, np.arange(12.0))
        data = {"zeta": (("time", "state"), zeta), "cost": ("time", 3.0 * time)}
        data["attenuated"] = ("time", time)
        made.append(xr.Dataset(data, {"time": time}, {"mode": "game"}))
    return made[0], made[1]


def test_frames_are_the_records() -> None:
    learned, optimal = runs()
    shown = frames(learned, optimal, 9)
    np.testing.assert_allclose(shown.time, np.arange(9) / 2)
    np.testing.assert_allclose(shown.learned[:, 5], 5.0 * (1 - shown.time / 4))
    np.testing.assert_allclose(shown.optimal[:, 1], np.maximum(1 - shown.time / 2, 0.0), atol=1e-15)
    np.testing.assert_allclose(shown.learned_cost, 2.0 * shown.time)
    np.testing.assert_allclose(shown.optimal_cost, np.minimum(3.0 * shown.time, 6.0))


def test_the_hull_points_where_the_vehicle_does() -> None:
    zeta = np.zeros(12)
    zeta[:2], zeta[5] = (3.0, 1.0), np.pi / 2  # heading east
    corners = outline(zeta, 2.0)
    np.testing.assert_allclose(corners[0], [1.0 + 2.0 * HULL[0, 0], 3.0])
    np.testing.assert_allclose(corners[2], [0.5, 3.0 - 0.28])  # aft starboard is west and south


def test_a_gif_has_its_frames_and_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(films.writers, "is_available", lambda name: name == "pillow")
    path = animate(tmp_path, *runs(), speed=8.0)
    assert [file.name for file in tmp_path.iterdir()] == [path.name] == ["animation.gif"]
    with Image.open(path) as film:
        assert film.n_frames == 6  # 4 s, eight times as fast, ten frames a second
        assert film.info["duration"] == 1000 / FRAMES_PER_SECOND
    assert path.stat().st_size < 3_000_000


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="there is no ffmpeg")
def test_an_mp4_has_its_frames_and_its_time(tmp_path: Path) -> None:
    """As ffprobe counts them."""
    path = animate(tmp_path, *runs(), speed=8.0)
    assert [file.name for file in tmp_path.iterdir()] == [path.name] == ["animation.mp4"]
    asked = [
        "-count_frames",
        "-show_entries",
        "stream=codec_name,nb_read_frames,duration",
        "-of",
        "json",
    ]
    told = subprocess.run(["ffprobe", "-v", "error", *asked, path], capture_output=True, check=True)
    (stream,) = json.loads(told.stdout)["streams"]
    assert stream["codec_name"] == "h264"
    assert int(stream["nb_read_frames"]) == 6
    assert float(stream["duration"]) == pytest.approx(6 / FRAMES_PER_SECOND)


def test_without_a_writer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, one_sentence: Callable[[BaseException], str]
) -> None:
    monkeypatch.setattr(films.writers, "is_available", lambda name: False)
    with pytest.raises(InputError) as caught:
        animate(tmp_path, *runs())
    assert "ffmpeg" in one_sentence(caught.value)
    assert list(tmp_path.iterdir()) == []

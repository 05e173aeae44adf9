"""Presets named after systems: their files, and the rules of OpenVINS and VINS written down once more."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
import tomlkit
from benchmarks.documents import presets

from tracknoise.exceptions import UnknownNameError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame, check_quality, check_step
from tracknoise.trackers.tracker_registry import (
    TRACKERS,
    load_preset,
    make_tracker,
    preset_names,
    preset_text,
    tracker_defaults,
)

SIZE = (376, 300)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """A texture with corners that turns, grows and slides, with noise; one is covered for the most part, one black."""
    rng = np.random.default_rng(3)
    coarse = cv2.resize(rng.integers(0, 255, (70, 90)).astype(np.uint8), None, fx=9, fy=9)
    blocks = cv2.resize(rng.integers(0, 160, (105, 135)).astype(np.uint8), (810, 630), interpolation=cv2.INTER_NEAREST)
    texture = cv2.GaussianBlur(cv2.addWeighted(coarse, 0.4, blocks, 0.6, 30), (0, 0), 1.0)
    images = []
    for k in range(16):
        motion = cv2.getRotationMatrix2D((400, 300), 0.7 * k, 1 + 0.006 * k)
        motion[:, 2] += (-200 - 4.3 * k, -150 + 1.7 * k)
        image = cv2.warpAffine(texture, motion, SIZE, flags=cv2.INTER_CUBIC)
        images.append(np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8))
    images[9][40:, 60:] = 128
    images[11][:] = 0
    return [Frame(k, image) for k, image in enumerate(images)]


def without_rejection(name: str):
    return replace(make_tracker(name), rejection=Rejection(model=Model.none))


def reported(settings, frames, setting) -> list[dict[int, list[float]]]:
    """Positions by id in each frame."""
    tracker = settings.start(setting(size=SIZE))
    steps = [tracker.step(frame) for frame in frames]
    return [dict(zip(step.ids.tolist(), step.uv.tolist(), strict=True)) for step in steps]


def vins(frames: list[Frame], *, clahe: bool, back: bool) -> list[dict[int, list[float]]]:
    """VINS' front end without rejection: every image is one whose features are published."""
    width, height = SIZE
    previous, live, seen, next_id = None, [], [], 0  # live: (age, id, position)
    for frame in frames:
        image = cv2.createCLAHE(3.0, (8, 8)).apply(frame.image) if clahe else frame.image
        if live:
            old = np.float32([position for _, _, position in live])
            new, found, _ = cv2.calcOpticalFlowPyrLK(previous, image, old, None, winSize=(21, 21), maxLevel=3)
            ok = found[:, 0] == 1
            if back:
                again, reached, _ = cv2.calcOpticalFlowPyrLK(
                    image, previous, new, old.copy(), winSize=(21, 21), maxLevel=1,
                    criteria=(3, 30, 0.01), flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
                )  # fmt: skip
                ok &= (reached[:, 0] == 1) & (np.linalg.norm((again - old).astype(float), axis=1) <= 0.5)
            kept = []
            for (age, i, _), position, good in zip(live, new, ok, strict=True):
                x, y = np.rint(position)
                if good and 1 <= x < width - 1 and 1 <= y < height - 1:
                    kept.append((age + 1, i, position))
            live = sorted(kept, key=lambda feature: -feature[0])
        mask, spread = np.full(image.shape, 255, np.uint8), []
        for feature in live:
            x, y = np.rint(feature[2]).astype(int).tolist()
            if mask[y, x] == 255:
                spread.append(feature)
                cv2.circle(mask, (x, y), 30, 0, -1)
        live = spread
        if len(live) < 150:
            corners = cv2.goodFeaturesToTrack(image, 150 - len(live), 0.01, 30, mask=mask)
            for corner in [] if corners is None else corners[:, 0]:
                live.append((1, next_id, corner))
                next_id += 1
        previous = image
        seen.append({i: position.tolist() for _, i, position in live})
    return seen


@pytest.mark.parametrize(("name", "clahe", "back"), [("vins-mono", True, False), ("vins-fusion", False, True)])
def test_vins_births_and_steps_are_those_of_its_rule(frames, setting, name, clahe, back):
    ours, theirs = reported(without_rejection(name), frames, setting), vins(frames, clahe=clahe, back=back)
    assert [len(step) for step in ours] == [len(step) for step in theirs]
    assert ours == theirs
    assert len(set().union(*ours)) > 60
    assert any(0 in step for step in ours[4:])


def openvins(frames: list[Frame]) -> list[dict[int, list[float]]]:
    """OpenVINS' front end for one camera, without rejection and masks."""
    width, height = SIZE
    last, live, next_id, seen = None, [], 0, []  # live: (id, position)

    def detect(image: np.ndarray, features: list) -> list:
        nonlocal next_id
        fine = np.zeros((height // 10, width // 10), bool)
        coarse, covered, kept = np.zeros((5, 5), int), np.zeros(image.shape, bool), []
        for i, position in features:
            x, y = int(position[0]), int(position[1])
            row, column = int(position[1] / 10), int(position[0] / 10)
            if not (10 <= x < width - 10 and 10 <= y < height - 10):
                continue
            if row >= fine.shape[0] or column >= fine.shape[1] or fine[row, column]:
                continue
            fine[row, column] = True
            coarse[int(position[1] / (height / 5)), int(position[0] / (width / 5))] += 1
            if x - 10 >= 0 and x + 10 < width and y - 10 >= 0 and y + 10 < height:
                covered[y - 10 : y + 11, x - 10 : x + 11] = True
            kept.append((i, position))
        if 200 - len(kept) < 20:
            return kept
        wide, high, corners = width // 5, height // 5, []
        for column in range(5):
            for row in range(5):
                if coarse[row, column] >= 4:
                    continue
                left, top = column * wide, row * high
                found = cv2.FastFeatureDetector.create(20).detect(image[top : top + high, left : left + wide].copy())
                for point in sorted(found, key=lambda one: -one.response)[:9]:
                    x, y = point.pt[0] + left, point.pt[1] + top
                    if not covered[int(y), int(x)]:
                        corners.append((x, y))
        if corners:
            start = np.float32(corners).reshape(-1, 1, 2)
            for position in cv2.cornerSubPix(image, start, (5, 5), (-1, -1), (3, 20, 0.001))[:, 0]:
                row, column = int(position[1] / 10), int(position[0] / 10)
                if row < fine.shape[0] and column < fine.shape[1] and not fine[row, column]:
                    fine[row, column] = True
                    kept.append((next_id, position))
                    next_id += 1
        return kept

    for frame in frames:
        image = cv2.equalizeHist(frame.image)
        if not live:
            live = detect(image, [])
            seen.append({})
        else:
            live = detect(last, live)
            old = np.float32([position for _, position in live])
            new, found, _ = cv2.calcOpticalFlowPyrLK(
                last, image, old, old.copy(), winSize=(15, 15), maxLevel=5,
                criteria=(3, 30, 0.01), flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            )  # fmt: skip
            pairs = zip(live, new, found[:, 0], strict=True)
            live = [
                (i, position)
                for (i, _), position, good in pairs
                if good and position.min() >= 0 and int(position[0]) < width and int(position[1]) < height
            ]
            seen.append({i: position.tolist() for i, position in live})
        last = image
    return seen


def test_openvins_births_and_steps_are_those_of_its_rule(frames, setting):
    ours, theirs = reported(without_rejection("openvins"), frames, setting), openvins(frames)
    assert [len(step) for step in ours] == [len(step) for step in theirs]
    assert ours == theirs
    assert ours[0] == {}
    assert len(ours[1]) > 100
    assert len(set().union(*ours)) > 250


CAMERA = Camera(width=SIZE[0], height=SIZE[1], fx=300.0, fy=300.0, cx=187.5, cy=149.5)


@pytest.mark.parametrize("name", preset_names())
def test_every_step_of_a_preset_fits_to_those_before(frames, setting, name):
    beside = np.eye(4)
    beside[0, 3] = 0.1
    context = replace(setting(size=SIZE), camera_at=lambda index: CAMERA, pair=StereoPair(CAMERA, CAMERA, beside))
    tracker = make_tracker(name).start(context)
    live, followed = np.empty(0, dtype=np.int64), 0
    for frame in frames:
        step = tracker.step(Frame(frame.index, frame.image, lambda image=frame.image: np.roll(image, -6, axis=1)))
        check_step(step, live)
        check_quality(step.quality, len(step.ids))
        live = np.union1d(live[~np.isin(live, step.ended_ids)], step.ids)
        followed += np.count_nonzero(~step.born)
    assert followed > 100


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_states_the_source_of_every_value(name):
    preset, document = load_preset(name), tomlkit.parse(preset_text(name))
    assert re.fullmatch(r"[0-9a-f]{7,8}", preset.commit)
    assert preset.tracker in TRACKERS.names()
    assert preset.differs
    assert all(sentence.endswith(".") for sentence in preset.differs)

    def check(table: tomlkit.items.Table) -> None:
        for key, value in table.items():
            if isinstance(value, tomlkit.items.Table):
                check(value)
            else:
                assert value.trivia.comment.startswith("# "), key

    check(document["options"])


def test_the_page_of_presets_has_every_value_with_its_source():
    assert presets.PAGE.read_text(encoding="utf-8").partition(presets.START)[2] == presets.tables()


def test_options_of_ones_own_take_precedence_over_those_of_a_preset():
    changed = make_tracker("openvins", {"window_px": 21, "detection": {"threshold": 30}})
    plain = make_tracker("openvins")
    assert changed == replace(plain, window_px=21, detection=replace(plain.detection, threshold=30))


def test_an_unknown_preset_is_refused_with_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"'openvins'.*known: basalt, "):
        load_preset("open-vins")
    with pytest.raises(UnknownNameError, match=r"unknown tracker 'open-vins' \(did you mean 'openvins'\?\)"):
        make_tracker("open-vins")


def test_the_settings_of_a_preset_are_shown_with_their_sources():
    shown = tracker_defaults("openvins")
    assert "ov_core/src/track/Grider_GRID.h" in shown
    assert "differs = [" in shown

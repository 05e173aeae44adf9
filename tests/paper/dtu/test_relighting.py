import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.paper.dtu import LIGHTINGS, WEIGHT_STEPS, read_leds, weights
from tracknoise.paper.light_stage import led_positions

LEDS = led_positions()
BY_NAME = dict(zip(LIGHTINGS, weights(LEDS), strict=True))


def row(x: float = 0.0, y: float = 0.0, z: float = 1.0) -> str:
    return f"{x},{y},{z}"


def rows(count: int = 19) -> list[str]:
    return [row(0.1 * index) for index in range(count)]


def test_there_are_nineteen_lightings() -> None:
    assert list(LIGHTINGS) == ["diffuse", *(f"BF{k}" for k in range(8)), *(f"LR{k}" for k in range(10))]


def test_weights_are_shares_in_steps_that_float32_adds_exactly() -> None:
    shares = weights(LEDS)
    assert (shares >= 0).all()
    assert (shares.sum(axis=1) == 1.0).all()
    np.testing.assert_array_equal(shares * WEIGHT_STEPS, np.rint(shares * WEIGHT_STEPS))
    assert 4 * 255 * WEIGHT_STEPS < 2**24


def test_diffuse_light_is_that_of_all_leds_alike() -> None:
    np.testing.assert_allclose(BY_NAME["diffuse"], 1 / 19, atol=1 / WEIGHT_STEPS)


@pytest.mark.parametrize(
    ("lighting", "place"),
    [
        ("BF0", (0.0, 0.25 * np.sqrt(3.0))),
        ("BF7", (0.0, -0.25 * np.sqrt(3.0))),
        ("BF2", (0.0, 0.25 * np.sqrt(3.0) * (1 - 4 / 7))),
        ("LR0", (-0.5, 0.0)),
        ("LR9", (0.5, 0.0)),
        ("LR3", (-0.5 + 3 / 9, 0.0)),
    ],
)
def test_directional_light_falls_with_the_distance_from_its_place(lighting: str, place: tuple[float, float]) -> None:
    gaussian = np.exp(-np.square(LEDS[:, :2] - place).sum(axis=1) / (2 * 0.2**2))
    np.testing.assert_allclose(BY_NAME[lighting], gaussian / gaussian.sum(), atol=1 / WEIGHT_STEPS)


def test_the_first_lights_come_from_the_back_and_the_left() -> None:
    x, y = LEDS[:, 0], LEDS[:, 1]
    across = [float(BY_NAME[f"LR{k}"] @ x) for k in range(10)]
    along = [float(BY_NAME[f"BF{k}"] @ y) for k in range(8)]
    assert across == sorted(across)
    assert along == sorted(along, reverse=True)
    assert across[0] < -0.3
    assert along[0] > 0.3


def test_height_and_origin_do_not_matter() -> None:
    np.testing.assert_array_equal(weights(LEDS + np.array([3.0, -2.0, 5.0])), weights(LEDS))


@pytest.mark.parametrize("header", [[], ["x,y,z"], ["", "x, y, z", ""]])
def test_leds_are_read_with_a_header_and_without(tmp_path, header) -> None:
    path = tmp_path / "leds.csv"
    path.write_text("\n".join([*header, *rows(), ""]))
    leds = read_leds(path)
    assert leds.shape == (19, 3)
    np.testing.assert_allclose(leds[18], (1.8, 0.0, 1.0))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (rows(18), ": 18 LEDs, expected 19 rows of x,y,z in metres"),
        (rows(20), ": 20 LEDs, expected 19 rows of x,y,z in metres"),
        ([], ": 0 LEDs, expected 19 rows of x,y,z in metres"),
        ([*rows(4), "1,2", *rows(14)], ":5: 1,2, expected x,y,z in metres"),
        ([*rows(4), "1,2,up", *rows(14)], ":5: 1,2,up, expected x,y,z in metres"),
        ([*rows(4), "1,2,nan", *rows(14)], ":5: 1,2,nan, expected x,y,z in metres"),
        ([row(250.0 * index) for index in range(19)], ": LEDs 4500 apart, expected 19 rows of x,y,z in metres, up"),
        ([row()] * 19, ": LEDs 0 apart, expected 19 rows"),
    ],
)
def test_wrong_files_of_leds_are_refused_in_one_line(tmp_path, lines, message) -> None:
    path = tmp_path / "leds.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(DataError) as caught:
        read_leds(path)
    assert str(caught.value).startswith(f"{path}{message}")
    assert "\n" not in str(caught.value)


def test_a_missing_file_of_leds(tmp_path) -> None:
    with pytest.raises(DataError, match=r"leds\.csv: no such file, expected 19 rows of x,y,z in metres"):
        read_leds(tmp_path / "leds.csv")
    (tmp_path / "leds.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DataError, match=r"leds\.csv: not UTF-8 in line 1, expected text"):
        read_leds(tmp_path / "leds.csv")


def test_a_field_beyond_what_csv_allows_is_one_line(tmp_path):
    (tmp_path / "leds.csv").write_text('"' + "1" * 200_000)
    with pytest.raises(DataError, match=r"leds.csv: unreadable file, expected 19 rows of x,y,z in metres$"):
        read_leds(tmp_path / "leds.csv")

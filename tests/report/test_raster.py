import cv2
import numpy as np

from tracknoise.report.figure_files import png_of

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20" viewBox="0 0 30 20">
<rect width="30" height="20" fill="#ffffff"/><rect x="10" width="20" height="20" fill="#0000ff"/></svg>"""


def test_a_png_shows_what_the_svg_shows() -> None:
    image = cv2.imdecode(np.frombuffer(png_of(SVG, scale=2), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (40, 60, 3)
    assert (image[:, :19] == 255).all()
    assert (image[:, 21:] == (255, 0, 0)).all()  # blue

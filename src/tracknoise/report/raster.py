"""PNG files of figures.

They are drawn by way of a PDF. That takes half the time of drawing them from the SVG (`vl_convert.svg_to_png`), and the
files are less than half as large.
"""

import io

import pypdfium2 as pdfium
import vl_convert as vlc

_COMPRESSION = 6


def png_of(svg: str, *, scale: float) -> bytes:
    """Draw a figure.

    Parameters
    ----------
    svg
        The figure.
    scale
        Pixels per pixel of the figure on the page.

    Returns
    -------
    bytes
        A PNG file, RGB.
    """
    with pdfium.PdfDocument(vlc.svg_to_pdf(svg)) as document:
        image = document[0].render(scale=scale).to_pil()
    written = io.BytesIO()
    image.save(written, "png", compress_level=_COMPRESSION)
    return written.getvalue()

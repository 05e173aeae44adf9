"""PNG files of figures.

They are drawn from the PDF of a figure. Drawn from the SVG, each clipped group has a canvas of its own, which takes
three times as long.
"""

import io

import pypdfium2 as pdfium

_COMPRESSION = 6


def png_of(pdf: bytes, *, scale: float) -> bytes:
    """Draw the first page of a PDF file.

    Parameters
    ----------
    pdf
        The file.
    scale
        Pixels per point, which is a pixel of the figure on the page.

    Returns
    -------
    bytes
        A PNG file, RGB.
    """
    with pdfium.PdfDocument(pdf) as document:
        image = document[0].render(scale=scale).to_pil()
    written = io.BytesIO()
    image.save(written, "png", compress_level=_COMPRESSION)
    return written.getvalue()

import re

import vl_convert as vlc

from tracknoise.report.canonical_pdf import canonical_pdf

# Two fonts and several opacities: the library numbers fonts, and lists the resources, in random order.
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="90" height="60" font-family="Liberation Sans">'
    '<text y="10">plain</text>'
    + '<text y="30" font-weight="bold">bold</text>'
    + "".join(f'<g opacity="0.{n}"><rect x="{9 * n}" width="9" height="9"/></g>' for n in range(1, 9))
    + "</svg>"
)


def test_drawings_of_one_figure_are_the_same_bytes() -> None:
    drawn = [vlc.svg_to_pdf(SVG) for _ in range(12)]
    assert len(set(drawn)) > 1, "the library is deterministic: canonical_pdf is no longer needed"
    assert len({canonical_pdf(content) for content in drawn}) == 1


def test_every_object_is_kept_and_found_by_its_reference() -> None:
    drawn = vlc.svg_to_pdf(SVG)
    made = canonical_pdf(drawn)
    assert made.startswith(drawn[:9])
    numbers = [int(number) for number in re.findall(rb"(?m)^(\d+) 0 obj$", made)]
    assert numbers == list(range(1, 1 + len(re.findall(rb"(?m)^\d+ 0 obj$", drawn))))
    start = int(made.split(b"startxref\n")[1].split()[0])
    assert made[start:].startswith(b"xref\n0 %d\n" % (len(numbers) + 1))
    places = re.findall(rb"(?m)^(\d{10}) 00000 n $", made[start:])
    for number, place in zip(numbers, places, strict=True):
        assert made[int(place) :].startswith(b"%d 0 obj\n" % number)
    assert b"/Size %d\n" % (len(numbers) + 1) in made[start:]
    assert sorted(re.findall(rb"(?s)\nstream\n.*?\nendstream", made)) == sorted(
        re.findall(rb"(?s)\nstream\n.*?\nendstream", drawn)
    )


def test_references_lead_to_what_they_did_before() -> None:
    drawn = vlc.svg_to_pdf(SVG)
    for content in (drawn, canonical_pdf(drawn)):
        objects = {int(n): text for n, text in re.findall(rb"(?ms)^(\d+) 0 obj\n(.*?)\nendobj$", content)}
        root, info = (int(re.search(rb"/%s (\d+) 0 R" % name, content)[1]) for name in (b"Root", b"Info"))  # type: ignore[index]
        assert b"/Type /Catalog" in objects[root]
        assert b"/Producer" in objects[info]
        fonts = [objects[int(n)] for n in re.findall(rb"/fo\d (\d+) 0 R", content)]
        assert {b"Bold" in font for font in fonts} == {True, False}

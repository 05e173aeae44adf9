"""Materials of visuals: ``<material>`` elements and Ogre's material scripts."""

import re
from pathlib import Path

from tracknoise.foreign.files import is_regular_file, read_any_text
from tracknoise.foreign.xml_file import Element
from tracknoise.simulation.sdf.library import Library
from tracknoise.simulation.sdf.part import NUMBER, Look, even
from tracknoise.simulation.sdf.remarks import Remarks
from tracknoise.simulation.sdf.xml import numbers, text_of


def own_look(material: Element | None, file: Path, library: Library, remarks: Remarks) -> Look | None:
    """Material of a whole visual.

    Parameters
    ----------
    material
        The ``<material>`` of a visual.
    file
        The SDF file that contains it.
    library
        Where to search for scripts and textures.
    remarks
        Collects what is not supported or not found.

    Returns
    -------
    Look or None
        None if it defines nothing, so that the materials of the mesh are used.
    """
    if material is None:
        return None
    script = material.find("script")
    look = None if script is None else _scripted(script, file, library, remarks)
    albedo = next((item.text for item in material.iter("albedo_map") if item.text), None)
    if look is None and albedo is not None:
        look = _textured(albedo.strip(), file.parent, file, library, remarks)
    diffuse = material.find("diffuse")
    if look is None and diffuse is not None:
        count = 4 if len((diffuse.text or "").split()) == 4 else 3
        look = even(*numbers(diffuse, count, file)[:3])
    return look


def _scripted(script: Element, file: Path, library: Library, remarks: Remarks) -> Look | None:
    """Look of an Ogre material, by its name, from the first script that has it."""
    name = text_of(script, "name") or ""
    for uri in script.findall("uri"):
        place = library.find((uri.text or "").strip(), file.parent)
        for path in () if place is None else sorted(place.glob("*.material")) if place.is_dir() else (place,):
            body = _body(read_any_text(path, "a material script"), name) if is_regular_file(path) else None
            if body is not None:
                return _look(body, name, path, library, remarks)
    remarks.add(file, f"material {name!r} is not found; it is ignored")
    return None


def _look(body: str, name: str, path: Path, library: Library, remarks: Remarks) -> Look | None:
    texture = re.search(r"^[ \t]*texture[ \t]+(\S+)", body, re.MULTILINE)
    if texture is not None:
        return _textured(texture[1], path.parent, path, library, remarks)
    diffuse = re.search(rf"^[ \t]*diffuse((?:[ \t]+{NUMBER}){{3}})", body, re.MULTILINE)
    if diffuse is not None:
        return even(*(float(word) for word in diffuse[1].split()))
    remarks.add(path, f"material {name!r} has neither texture nor diffuse colour; it is ignored")
    return None


def _textured(name: str, beside: Path, place: Path, library: Library, remarks: Remarks) -> Look | None:
    texture = library.find_texture(name, beside)
    if texture is None:
        remarks.add(place, f"texture {name!r} is not found; it is ignored")
        return None
    return Look(texture)


def _body(script: str, name: str) -> str | None:
    """Text between the braces of a material in a script. The time of the search grows with the length of the script."""
    start = re.search(rf"^[ \t]*material[ \t]+{re.escape(name)}(?:[ \t]*:[^{{\n]*+)?\s*+{{", script, re.MULTILINE)
    if start is None or not name:
        return None
    depth, end = 1, start.end()
    while depth and end < len(script):
        depth += {"{": 1, "}": -1}.get(script[end], 0)
        end += 1
    return script[start.end() : end]

"""Which band of its photos a modality is, as a capture says it: several may share their files."""

from collections.abc import Sequence
from dataclasses import replace

from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.radiometric.tiff_bands import MOST_BANDS

PHOTOS_BY = ("folder", "photos", "camera")  # what says which photos a modality has


def stated_bands(listed: object, where: str) -> dict[str, int]:
    """Of the modalities that have 'band': which, counted from 1.  Raises BadFile."""
    found: dict[str, int] = {}
    for entry in listed if isinstance(listed, list) else ():
        if isinstance(entry, dict) and entry.get("band") is not None:
            fields = Fields(entry, f"{where}: modality {shown(entry.get('name'))}")
            found[fields.text("name")] = fields.count("band", 1, MOST_BANDS)
    return found


def with_bands(photos: Sequence[Photo], listed: object, where: str) -> list[Photo]:
    """The photos with their modalities' bands."""
    bands = stated_bands(listed, where)
    return [replace(photo, band=bands.get(photo.modality, 0)) for photo in photos]


def sharing_folders(listed: Sequence[object], where: str) -> dict[str, list[str]]:
    """Of modalities that are bands of the same photos: the first, and all of them in their order.

    listed: the entries of 'modalities', of which these say the same of their photos.
    """
    bands = stated_bands(listed, where)
    first: dict = {}
    found: dict = {}
    for entry in listed:
        fields = Fields(entry, where)
        name = fields.text("name")
        if name not in bands:
            continue
        said = {key: fields.data[key] for key in PHOTOS_BY if fields.has(key)}
        place = repr(said or name)
        found.setdefault(first.setdefault(place, name), []).append(name)
    return found


def only_bands(sharing: dict[str, list[str]]) -> set[str]:
    """The modalities whose photos are those of another one that comes before."""
    return {name for names in sharing.values() for name in names[1:]}


def of_each_band(photos: Sequence[Photo], sharing: dict[str, list[str]]) -> list[Photo]:
    """The photos of a first modality once for each that shares its folder."""
    return [
        photo if photo.modality == name else replace(photo, modality=name)
        for photo in photos
        for name in sharing.get(photo.modality, [photo.modality])
    ]

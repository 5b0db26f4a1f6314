"""What is doubtful about the photos of a capture, in words, before a training."""

from shapeshift.training.photos import LoadedPhoto

FEW = 10  # training photos of a modality, up to which what lies between them is a guess


def validate_views(photos: list[LoadedPhoto], masks: str) -> tuple[list[LoadedPhoto], list[str]]:
    """The photos to train on, and a sentence for each thing that a person should know.

    masks: that of TrainSettings.  Where a mask says that nothing lies outside of the object, a
    photo without one shows the contrary: such photos are left out while they are the smaller part
    of their modality.
    """
    kept, warnings = list(photos), []
    for name in dict.fromkeys(photo.modality for photo in photos):
        mine = [photo for photo in kept if photo.modality == name]
        bare = [photo for photo in mine if not photo.masked]
        if masks in ("auto", "object") and 0 < len(bare) < len(mine):
            out = 2 * len(bare) < len(mine)
            if out:
                kept = [p for p in kept if p.modality != name or p.masked]
                mine = [p for p in mine if p.masked]
            what = "are left out" if out else "count as a whole, with what lies behind the object"
            warnings.append(
                f"{name}: {len(bare)} photos without a mask, for example {bare[0].name}, {what}; "
                "make masks for them, or train with --masks ignore."
            )
        if len(mine) <= FEW:
            more = [p.modality for p in photos if p.modality != name]
            shared = max(set(more), key=more.count, default=name)
            plural = "s" if len(mine) > 1 else ""
            warnings.append(
                f"{name} has {len(mine)} training photo{plural} only: seen from elsewhere it "
                "will be a guess; 30 and more from all around are a good capture."
                + (
                    f"  If it shows the shapes of {shared}, it can share them: "
                    'fixed = "offset,scale,rotation,opacity" in the file of --settings.'
                    if more.count(shared) > FEW
                    else ""
                )
            )
    return kept, warnings

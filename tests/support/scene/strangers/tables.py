"""Situations of tables and files: what is written oddly, and what is not read without a word."""

import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from shapeshift.decomposition.poses.photo_list import list_photos
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.strangers.situations import (
    Shot,
    Situation,
    picture,
    short,
    write_colmap,
    write_frames,
    write_photos,
)

Change = Callable[[Path], object]


def files_in(path: Path) -> str:
    """The table of files: what is used of each kind, and what is left out and why."""
    try:
        capture = read_capture(path)
    except BadFile as error:
        return f"refused: {short(str(error), path)}"
    rows = [row for row in capture.files if row.kind != "points"]
    used = [f"{row.used} {row.kind}" for row in rows if row.used and row.kind != "models"]
    left = [f"left out: {row.left_out} {row.kind}, {row.why}" for row in rows if row.left_out]
    return "; ".join([", ".join(used), *left])


def searched(path: Path) -> str:
    """What `poses` takes for photos, and for what it takes the other pictures."""
    found = list_photos(path)
    kinds = Counter(kind for _, kind in found.others)
    return ", ".join([f"{len(found.photos)} photos", *(f"{n} {k}" for k, n in kinds.items())])


def photos_with(*changes: Change) -> Callable[[Path], Path]:
    """Three photos that nobody has posed."""

    def make(folder: Path) -> Path:
        write_photos(folder, [Shot(f"{i}.jpg") for i in range(3)])
        for change in changes:
            change(folder)
        return folder

    return make


def colmap_with(
    *changes: Change, names: str = "{}.png", more: str = "", mode: str = "RGB"
) -> Callable[[Path], Path]:
    """Six photos of one camera, then changed; more: names of as many pictures of another kind and
    mode that the model has, too.
    """

    def make(folder: Path) -> Path:
        others = [Shot(more.format(i), mode) for i in range(6)] if more else []
        write_colmap(folder, [*(Shot(names.format(i)) for i in range(6)), *others])
        for change in changes:
            change(folder)
        return folder

    return make


def frames_with(*changes: Change, other: str = "", **more) -> Callable[[Path], Path]:
    """other: names of as many depth photos that have frames of their own."""

    def make(folder: Path) -> Path:
        others = [Shot(other.format(i), "I;16") for i in range(6)] if other else []
        write_frames(folder, [*(Shot(f"images/{i}.png") for i in range(6)), *others], **more)
        for change in changes:
            change(folder)
        return folder

    return make


def table(change: Callable[[bytes], bytes], name: str = "images") -> Change:
    """Of a table of the model, its bytes changed."""

    def changed(folder: Path) -> None:
        path = folder / f"sparse/0/{name}.txt"
        path.write_bytes(change(path.read_bytes()))

    return changed


def masks(form: str, count: int = 6) -> Change:
    return lambda folder: [picture(folder / form.format(i), "L") for i in range(count)]


def pictures(*names: str) -> Change:
    return lambda folder: [picture(folder / name) for name in names]


def without(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


def text(name: str, data: bytes) -> Change:
    return lambda folder: (folder / name).write_bytes(data)


def second_model(folder: Path) -> None:
    """sparse/1 has all six images, sparse/0 two of them."""
    shutil.copytree(folder / "sparse/0", folder / "sparse/1")
    path = folder / "sparse/0/images.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:4]) + "\n")


def one_line_an_image(data: bytes) -> bytes:
    return b"\n".join(line for line in data.splitlines() if line)


def longer(data: bytes) -> bytes:
    """Quaternions of length 2."""
    rows = [line.split() for line in data.splitlines() if line]
    for row in rows:
        row[1:5] = [repr(2 * float(word)).encode() for word in row[1:5]]
    return b"".join(b" ".join(row) + b"\n\n" for row in rows)


def zero(data: bytes) -> bytes:
    number, *_ = data.split()
    return number + b" 0 0 0 0 1 2 3 1 0.png\n\n"


ALL = "6 photos"
NO_MASK = (
    "they have colours, or another shape than their photos, or their photos are grey or have masks "
    "elsewhere; call their folder masks/ if white counts"
)
SITUATIONS = [
    Situation("lines of Windows", "images.txt with CR LF, as RealityScan exports it",
              colmap_with(table(lambda data: data.replace(b"\n", b"\r\n"))), ALL, files_in),
    Situation("lines of old Macs", "images.txt with CR alone",
              colmap_with(table(lambda data: data.replace(b"\n", b"\r"))), ALL, files_in),
    Situation("a byte order mark", "tables saved by Windows' editor",
              colmap_with(*(table(lambda data: b"\xef\xbb\xbf" + data, name)
                            for name in ("images", "cameras", "points3D"))), ALL, files_in),
    Situation("UTF-16", "tables written by PowerShell",
              colmap_with(*(table(lambda data: data.decode().encode("utf-16"), name)
                            for name in ("images", "cameras", "points3D"))), ALL, files_in),
    Situation("another code page", "a name with an umlaut in the table of a Windows machine",
              colmap_with(table(lambda data: data.replace(b" 1.png", b" K\xfcche.png")),
                          lambda folder: (folder / "images/1.png").rename(
                              folder / "images/Küche.png")), ALL, files_in),
    Situation("one line an image", "images.txt without the lines of points",
              colmap_with(table(one_line_an_image)), ALL, files_in),
    Situation("no last line", "images.txt without the last empty line",
              colmap_with(table(lambda data: data.rstrip(b"\n"))), ALL, files_in),
    Situation("names with blanks", "A-DJI plan wp-2 (1).png",
              colmap_with(names="A-DJI plan wp-2 ({}).png"), ALL, files_in),
    Situation("long quaternions", "quaternions of length 2", colmap_with(table(longer)), ALL,
              files_in),
    Situation("no quaternion", "a quaternion of zeros", colmap_with(table(zero)),
              "refused: 0.png: its pose is no rotation and place", files_in),
    Situation("two models", "sparse/0 with two images, sparse/1 with six",
              colmap_with(second_model),
              "6 photos; left out: 1 models, not joined to sparse/1, which has 6 images", files_in),
    Situation("masks called like photos", "masks/0.jpg, COLMAP",
              colmap_with(masks("masks/{}.jpg")), "6 photos, 6 masks", files_in),
    Situation("masks in capitals", "masks/0.PNG", colmap_with(masks("masks/{}.PNG")),
              "6 photos, 6 masks", files_in),
    Situation("masks of RealityScan", "images/0.png.mask.png",
              colmap_with(masks("images/{}.png.mask.png")), "6 photos, 6 masks", files_in),
    Situation("masks of Metashape", "masks/0_mask.png",
              colmap_with(masks("masks/{}_mask.png")), "6 photos, 6 masks", files_in),
    Situation("masks of a model from Windows", "cam\\0.png and masks/cam/0.png",
              colmap_with(masks("masks/cam/{}.png"), names="cam\\{}.png"), "6 photos, 6 masks",
              files_in),
    Situation("masks of some photos", "masks for two of six",
              colmap_with(masks("masks/{}.png", 2)),
              "6 photos, 2 masks; left out: 4 masks, 2 photos of RGB have one and these have none",
              files_in),
    Situation("masks of other photos", "masks/frame_0.png for 0.png",
              colmap_with(masks("masks/frame_{}.png")),
              "6 photos; left out: 6 masks, no photo has their name", files_in),
    Situation("photos without poses", "photos that the mapper did not place",
              colmap_with(pictures("images/8.png", "images/9.png")),
              "6 photos; left out: 2 photos, they have no pose", files_in),
    Situation("photos that are not there", "a photo of the model that was not copied",
              colmap_with(without("images/3.png")),
              "5 photos; left out: 1 photos, the capture names them and they are not there",
              files_in),
    Situation("a list with a lost name", "train_list.txt names a photo that is none",
              colmap_with(text("train_list.txt", b"0.png\r\n1.PNG\r\nimages\\2.png\r\nx.png")),
              "3 photos; left out: 3 photos, they are in none of train_list.txt, "
              "validation_list.txt, test_list.txt; left out: 1 names in train_list.txt, no photo "
              "of the model has them", files_in),
    Situation("depth beside COLMAP", "depth/0.png, which no table of COLMAP names",
              colmap_with(pictures("depth/0.png")),
              "6 photos; left out: 1 depth photos, a COLMAP model names none, a transforms.json "
              "can", files_in),
    *(Situation(f"{word}/ beside images/", f"{word}/0.png of one channel, of the same names",
                colmap_with(masks(f"{word}/{{}}.png")), "6 photos, 6 masks", files_in)
      for word in ("alpha", "matte", "silhouette", "silhouettes")),
    Situation("alpha/ in colours", "alpha/0.png that is a photo",
              colmap_with(pictures("alpha/0.png")),
              f"6 photos; left out: 1 masks, {NO_MASK}", files_in),
    Situation("two places of heat", "images/alpha/ and images/beta/ of one channel",
              lambda folder: write_colmap(folder, [Shot(f"{place}/{i}.png", "L") for i in range(3)
                                                   for place in ("alpha", "beta")]),
              "6 photos", files_in),
    Situation("silhouettes beside masks", "masks/ and silhouettes/ for the same photos",
              colmap_with(masks("masks/{}.png"), masks("silhouettes/{}.png")),
              f"6 photos, 6 masks; left out: 6 masks, {NO_MASK}", files_in),
    *(Situation(f"{word} posed as photos", f"images/{form.format(0)} in COLMAP's table",
                colmap_with(names=name, more=form, mode=mode),
                f"6 photos; left out: 6 {kind}, they are posed as photos; a transforms.json can "
                "name them, capture.json can make a stop", files_in)
      for word, name, form, mode, kind in (
          ("depth photos", "rgb/{}.png", "depth/{}.png", "I;16", "depth photos"),
          ("depth in false colours", "{}.png", "depth_maps/{}.png", "RGB", "depth photos"),
          ("depth photos by name", "r_{}.png", "r_{}_depth_0001.png", "L", "depth photos"),
          ("normal maps", "rgb/{}.png", "normals/{}.png", "RGB", "normal maps"),
          ("classes", "rgb/{}.png", "segmentation/{}.png", "RGB", "pictures of classes"))),
    *(Situation(f"{word} posed as photos", f"images/{form.format(0)} in COLMAP's table",
                colmap_with(names="rgb/{}.png", more=form, mode="L"), "6 photos, 6 masks", files_in)
      for word, form in (("masks", "masks/{}.png"), ("silhouettes", "silhouettes/{}.png"),
                         ("masks of RealityScan", "rgb/{}.png.mask.png"))),
    *(Situation(f"photos in {word}/", f"images/rgb/ and images/{word}/ of colours",
                colmap_with(names="rgb/{}.png", more=f"{word}/{{}}.png"), "12 photos", files_in)
      for word in ("depth_of_field", "masks", "alpha", "normal")),
    Situation("depth photos with frames", "images/0.png and depth/0.png in transforms.json",
              frames_with(other="depth/{}.png"),
              "6 photos; left out: 6 depth photos, they have frames as photos do; 'modality' makes "
              "a stop of them", files_in),
    *(Situation(f"poses of photos beside {word}", f"0.jpg and {form.format(0)} in one folder",
                photos_with(masks(form, 3)), f"3 photos, 3 {kind}", searched)
      for word, form, kind in (
          ("masks of RealityScan", "{}.jpg.mask.png", "masks"),
          ("masks of Metashape", "{}_mask.png", "masks"), ("masks/", "masks/{}.png", "masks"),
          ("silhouettes/", "silhouettes/{}.png", "masks"),
          ("instant-ngp's masks", "dynamic_mask_{}.png", "masks"),
          ("depth/", "depth/{}.png", "depth photos"))),
    Situation("poses of photos of masks", "photos in colours in masks/ and in vases/",
              photos_with(pictures(*(f"masks/{i}.jpg" for i in range(3)))), "6 photos", searched),
    Situation("frames beside other photos", "a photo that no frame names",
              frames_with(pictures("images/9.png")),
              "6 photos; left out: 1 photos, they have no pose", files_in),
    Situation("masks that no frame names", "masks/0.png beside transforms.json",
              frames_with(masks("masks/{}.png")),
              "6 photos; left out: 6 masks, no frame names one ('mask_path')", files_in),
    Situation("frames in no list", "train_filenames of two of six",
              frames_with(train_filenames=["images/0.png", "./images/1.png"]),
              "2 photos; left out: 4 photos, they are in none of its lists (train_filenames, "
              "val_filenames, test_filenames)", files_in),
]  # fmt: skip

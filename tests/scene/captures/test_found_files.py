"""What a capture found, used and left out: masks by any name, other models, lists, what lies by."""

import json
import os
import shutil

import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import files_below, photo_key
from shapeshift.scene.captures.colmap_tables import find_model, images_in, models_in
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.mask_files import masks_in
from tests.support.scene.captures import colmap_model, save_image, simple, write_transforms

SIZE = (16, 12)


def mask(path):
    return save_image(path, SIZE, mode="L")


def rows_of(capture, kind):
    return [(row.found, row.used, row.left_out) for row in capture.files if row.kind == kind]


@pytest.fixture
def model(tmp_path):
    """Four photos of rgb/ and three of thermal/, all whole."""
    colmap_model(tmp_path, True)
    return tmp_path


def test_a_whole_capture_leaves_nothing_out(model):
    capture = read_capture(model)
    assert [(row.kind, row.found, row.used, row.left_out) for row in capture.files] == [
        ("photos", 7, 7, 0),
        ("points", 20, 20, 0),
    ]
    assert capture.doubts == ()


NAMED = [
    "masks/rgb/1.png", "masks/rgb/1.png.png", "masks/rgb/1.PNG", "masks/rgb/1.jpg",
    "Masks/RGB/1.JPG", "masks/rgb/1.jpeg", "masks/rgb/1.tif", "masks/rgb/1.webp",
    "masks/rgb/1.png.mask.png",
    "masks/rgb/1.mask.png", "masks/rgb/1_mask.png", "masks/rgb/1.png_mask.png", "mask/rgb/1.png",
    "images_mask/rgb/1.png", "image_masks/rgb/1.png", "images/rgb/1.png.mask.png",
    "images/rgb/1_mask.png", "images/rgb/1.mask.PNG", "images/_mask/rgb/1.png",
    "images/rgb/_mask/1.png", "images/rgb/masks/1.png", "images/masks/rgb/1.png.png",
    "MASKS/RGB/1_MASK.PNG", "masks/rgb/1.Mask.png", "images/rgb/1.PNG.MASK.png",
    "masks_2/rgb/1.png", "mask_4/rgb/1.png",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMED)
def test_masks_are_found_as_photos_are(model, name):
    path = mask(model / name)
    capture = read_capture(model)
    of = {photo.path.name: photo.mask for photo in capture.photos if photo.modality == "rgb"}
    assert of == {"0.png": None, "1.png": path, "2.png": None, "3.png": None}
    assert rows_of(capture, "masks") == [(1, 1, 0), (0, 0, 3)]
    (said,) = (doubt for doubt in capture.doubts if "have none of the masks" in doubt)
    assert said.startswith("3 photos of rgb have none of the masks that 1 others have")
    assert not any("no pose" in doubt for doubt in capture.doubts)


def test_back_slashes_and_composed_letters(model):
    """As Windows writes names and macOS umlauts, in the table as on the disk."""
    path = model / "sparse/0/images.txt"
    path.write_text(path.read_text().replace("rgb/1.png", "rgb\\K\u00fcche.png"))
    (model / "images/rgb/1.png").rename(model / "images/rgb/Ku\u0308che.png")
    found = mask(model / "masks/rgb/KU\u0308CHE.png")
    assert found in {photo.mask for photo in read_capture(model).photos}


@pytest.mark.parametrize(
    ("masks", "taken"),
    [
        (["masks/1.png"], False),  # of rgb/1.png or of thermal/1.png
        (["masks/3.png"], True),  # thermal has three
        (["masks/a/3.png"], False),
        (["masks/3.png", "masks/a/3.png"], False),
    ],
)
def test_a_mask_without_folder_is_of_the_one_photo_of_its_name(model, masks, taken):
    for name in masks:
        mask(model / name)
    capture = read_capture(model)
    assert any(photo.mask for photo in capture.photos) is taken
    if not taken:
        assert rows_of(capture, "masks") == [(len(masks), 0, len(masks))]
        assert any("no photo has their name" in doubt for doubt in capture.doubts)


def test_png_goes_first_and_the_others_are_left_out(model):
    first, *_ = [mask(model / f"masks/rgb/1{end}") for end in (".png", ".jpg", ".tif")]
    capture = read_capture(model)
    assert {photo.mask for photo in capture.photos} == {None, first}
    assert rows_of(capture, "masks")[1] == (2, 0, 2)


@pytest.mark.parametrize("name", ["dynamic_masks/rgb/1.png", "segmentation/rgb/1.png",
                                  "sky_masks/1.png", "images/rgb/dynamic_mask_1.png"])  # fmt: skip
def test_masks_whose_white_is_something_else_are_not_taken(model, name):
    mask(model / name)
    capture = read_capture(model)
    assert not any(photo.mask for photo in capture.photos)
    assert rows_of(capture, "masks") == [(1, 0, 1)] and rows_of(capture, "photos") == [(7, 7, 0)]
    assert sum("their white hides" in doubt for doubt in capture.doubts) == 1


def test_a_photo_may_be_called_like_a_mask(model):
    path = model / "sparse/0/images.txt"
    path.write_text(path.read_text().replace("rgb/1.png", "rgb/1_mask_0.png"))
    (model / "images/rgb/1.png").rename(model / "images/rgb/1_mask_0.png")
    own = mask(model / "masks/rgb/1_mask_0.png")
    capture = read_capture(model)
    assert {p.path.name: p.mask for p in capture.photos if p.mask} == {"1_mask_0.png": own}


def test_masks_of_smaller_photos_are_those_of_their_folder(model):
    (model / "images").rename(model / "images_2")
    mask(model / "masks/rgb/1.png")
    small = mask(model / "masks_2/rgb/1.png")
    assert small in {photo.mask for photo in read_capture(model).photos}


def test_photos_and_masks_behind_links(model):
    """Folders of photos are often links; one that leads into itself is walked once."""
    (model / "images").rename(model / "elsewhere")
    (model / "images").symlink_to(model / "elsewhere", target_is_directory=True)
    (model / "elsewhere/again").symlink_to(model / "elsewhere", target_is_directory=True)
    save_image(model / "elsewhere/rgb/new.png", SIZE)
    mask(model / "other/rgb/1.png")
    (model / "masks").symlink_to(model / "other", target_is_directory=True)
    capture = read_capture(model)
    assert rows_of(capture, "photos") == [(7, 7, 0), (1, 0, 1)]
    assert rows_of(capture, "masks")[0] == (1, 1, 0)


def test_photos_without_poses_are_counted(model):
    for name in ("rgb/new.png", "lidar/0.jpg", "rgb/IMG.HEIC", "rgb/0_depth.png", "rgb/notes.txt",
                 "rgb/.hidden.png", "@eaDir/0.jpg", "__MACOSX/0.jpg"):  # fmt: skip
        (model / "images" / name).parent.mkdir(exist_ok=True)
        shutil.copy(model / "images/rgb/0.png", model / "images" / name)
    capture = read_capture(model)
    assert rows_of(capture, "photos") == [(7, 7, 0), (3, 0, 3)]
    assert rows_of(capture, "other pictures") == [(1, 0, 1)]
    assert any(
        doubt == "3 photos are left out: they have no pose, for example images/lidar/0.jpg."
        for doubt in capture.doubts
    )


def smaller_model(folder, source, images):
    """A copy of a text model with some of its images, and their number."""
    folder.mkdir(parents=True)
    rows = [r for r in (source / "images.txt").read_text().splitlines() if r and r[0] != "#"]
    (folder / "images.txt").write_text("\n\n".join(rows[n] for n in images) + "\n\n")
    shutil.copy(source / "cameras.txt", folder)
    return folder


def test_of_several_models_the_one_with_most_images_is_read(model):
    (model / "sparse/0").rename(model / "sparse/10")
    for number, images in enumerate([[0], [4, 5], [1], [2], [3]]):
        smaller_model(model / f"sparse/{number}", model / "sparse/10", images)
    (model / "sparse/old").mkdir()
    shutil.copy(model / "sparse/0/images.txt", model / "sparse/old")
    capture = read_capture(model)
    assert len(capture.photos) == 7 and rows_of(capture, "models") == [(1, 1, 0), (6, 0, 6)]
    (said,) = capture.doubts
    assert said.startswith("Of 7 models that are not joined, sparse/10 with 7 images is used, not ")
    assert "sparse/0 (1), sparse/1 (2)" in said and "..." in said
    chosen = read_capture(model / "sparse/1")  # as the sentence says
    assert [photo.path.name for photo in chosen.photos] == ["0.png", "1.png"]
    assert rows_of(chosen, "photos")[0] == (2, 2, 0)
    assert cli.main(["cameras", str(model), "--json"]) == 0


def test_a_model_in_sparse_itself_beside_others_is_said(model):
    smaller_model(model / "old", model / "sparse/0", [0, 1])
    for name in ("images.txt", "cameras.txt"):
        shutil.move(model / "old" / name, model / "sparse")
    capture = read_capture(model)
    assert rows_of(capture, "models") == [(1, 1, 0), (1, 0, 1)]
    (said,) = capture.doubts
    assert "sparse/0 with 7 images is used, not sparse (2);" in said
    assert len(read_capture(model / "sparse").photos) == 2  # as the sentence says


@pytest.mark.parametrize("broken", [b"", b"\xff" * 8, b"\x07" + bytes(7)])
def test_equal_models_and_broken_ones(model, broken):
    """The first of equals; a table that lies about its count has none."""
    smaller_model(model / "sparse/1", model / "sparse/0", range(7))
    (model / "sparse/2").mkdir()
    (model / "sparse/2/images.bin").write_bytes(broken)
    assert find_model(model) == (model / "sparse/0", ".txt")
    assert images_in(model / "sparse/2", ".bin") == -1
    assert [images_in(*found) for found in models_in(model / "sparse")] == [7, 7, -1]
    assert rows_of(read_capture(model), "models") == [(1, 1, 0), (2, 0, 2)]


def test_names_in_lists_are_compared_as_photos_are_found(model):
    """A byte order mark, CR LF, capitals, slashes, images/ before, endings left out."""
    (model / "train_list.txt").write_bytes(
        "\ufeffRGB/0.PNG\r\nrgb\\1.png\r\n./images/rgb/2.png\r\nthermal/0\r\n\r\n".encode()
    )
    (model / "test_list.txt").write_text("thermal/1.png\nnowhere.png\nrgb/3.jpg")
    capture = read_capture(model)
    splits = {(photo.modality, photo.path.stem): photo.split for photo in capture.photos}
    assert splits == dict.fromkeys(
        [("rgb", "0"), ("rgb", "1"), ("rgb", "2"), ("thermal", "0")], "train"
    ) | {("thermal", "1"): "test"}
    assert rows_of(capture, "photos") == [(5, 5, 0), (2, 0, 2)]
    assert rows_of(capture, "names in test_list.txt") == [(0, 0, 2)]
    assert any("names in test_list.txt are left out" in doubt for doubt in capture.doubts)


def test_depth_photos_beside_a_colmap_model_are_named(model):
    save_image(model / "depths/0.png")
    save_image(model / "normals/0.png")
    capture = read_capture(model)
    assert rows_of(capture, "depth photos") == rows_of(capture, "normal maps") == [(1, 0, 1)]


def test_points_of_the_other_kind_are_read_and_said(model):
    (model / "sparse/0/points3D.txt").unlink()
    (model / "sparse/0/points3D.bin").write_bytes((1).to_bytes(8, "little") + bytes(43) + bytes(8))
    capture = read_capture(model)
    assert len(capture.points) == 1 and any("points3D.bin" in doubt for doubt in capture.doubts)


def frames(folder, count=4, **more):
    made, top = simple(folder, count)
    return made, top | more


def test_frames_say_what_lies_beside_them(tmp_path):
    made, top = frames(tmp_path, 5)
    made[0]["mask_path"] = "masks/000.PNG"  # as the photo's: capitals and endings are found
    made[1]["depth_path"] = "depth/001.png"
    made[2]["depth_path"] = "depth/none.png"
    for name in ("masks/000.png", "masks/009.png", "images/007.png"):
        mask(tmp_path / name)
    for name in ("depth/001.png", "depth/009.png"):
        save_image(tmp_path / name, SIZE, mode="L")
    from PIL import Image

    for name in ("depth/001.png", "depth/009.png"):
        Image.new("I;16", SIZE, 5).save(tmp_path / name)
    (tmp_path / "images/004.png").unlink()
    write_transforms(tmp_path, made, **top)
    capture = read_capture(tmp_path)
    assert rows_of(capture, "photos") == [(4, 4, 0), (0, 0, 1), (1, 0, 1)]
    assert rows_of(capture, "masks") == [(1, 1, 0), (0, 0, 3), (1, 0, 1)]
    assert rows_of(capture, "depth photos") == [(1, 1, 0), (0, 0, 1), (0, 0, 2), (1, 0, 1)]
    said = " ".join(capture.doubts)
    for part in ("images/007.png", "masks/009.png", "depth/009.png", "3 photos of RGB have none"):
        assert part in said


def test_masks_that_no_frame_names_are_said(tmp_path):
    made, top = frames(tmp_path)
    for i in range(3):
        mask(tmp_path / f"masks/{i:03}.png")
    write_transforms(tmp_path, made, **top)
    capture = read_capture(tmp_path)
    assert not any(photo.mask for photo in capture.photos)
    assert rows_of(capture, "masks") == [(3, 0, 3)]
    assert any("mask_path" in doubt for doubt in capture.doubts)


def test_frames_in_none_of_the_lists_are_said(tmp_path):
    made, top = frames(tmp_path)
    write_transforms(tmp_path, made, **top, train_filenames=["IMAGES\\000.png", "./images/001.png"],
                     test_filenames=["images/nine.png"])  # fmt: skip
    capture = read_capture(tmp_path)
    assert rows_of(capture, "photos") == [(2, 2, 0), (2, 0, 2)]
    assert rows_of(capture, "names in its lists") == [(0, 0, 1)]


def test_info_shows_the_table(model, capsys):
    save_image(model / "images/rgb/new.png")
    assert cli.main(["info", str(model), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert json.loads(json.dumps(ss.info(model))) == told
    capture = read_capture(model)
    assert told["doubts"] == list(capture.doubts)
    assert [tuple(row.values()) for row in told["files"]] == [
        (r.kind, r.found, r.used, r.left_out, r.why, r.example) for r in capture.files
    ]
    assert [(s["name"], s["train"], s["test"]) for s in told["stops"]] == [
        ("rgb", 3, 1),
        ("thermal", 2, 1),
    ]
    assert cli.main(["info", str(model)]) == 0
    assert "they have no pose, images/rgb/new.png" in " ".join(capsys.readouterr().out.split())


def test_info_refuses_a_broken_capture_as_train_does(model, capsys):
    (model / "sparse/0/cameras.txt").unlink()
    assert cli.main(["info", str(model)]) == 2
    assert "cameras.txt is missing" in capsys.readouterr().err


def test_names_are_keys_whatever_their_slashes():
    assert {photo_key(name) for name in ("a/B.png", "A\\b.PNG", "./a//b.png", "/a/b.png")} == {
        "a/b.png"
    }
    assert photo_key("\u00c4/u\u0308.PNG") == photo_key("a\u0308/\u00fc.png")
    assert photo_key("../a.png") == "../a.png" and photo_key("") == ""


def test_a_folder_of_many_files_is_looked_at_in_part(tmp_path, monkeypatch):
    monkeypatch.setattr("shapeshift.scene.capture_files.MOST_FILES", 10)
    for i in range(12):
        (tmp_path / f"{i}").write_bytes(b"")
    assert len(files_below(tmp_path)) == 10
    assert files_below(tmp_path / "none") == []


def test_masks_for_poses(tmp_path):
    """--masks may name any folder; the names are as of captures."""
    for name in ("a.JPG.png", "sub/b_mask.png", "c.jpg", "z.png"):
        mask(tmp_path / name)
    of, others = masks_in(tmp_path, ["a.jpg", "sub/b.jpg", "C.png"])
    assert {key: path.name for key, path in of.items()} == {
        "a.jpg": "a.JPG.png", "sub/b.jpg": "b_mask.png", "c.png": "c.jpg",
    }  # fmt: skip
    assert [path.name for path in others] == ["z.png"]


@pytest.mark.skipif(os.name == "nt", reason="names of bytes are POSIX's")
def test_names_that_are_no_text_are_read_and_said(model, capsys):
    """Files of bytes, as an unpacked archive leaves them, and a table with the same bytes."""
    raw = os.fsdecode(b"rgb/caf\xe9.png")
    path = model / "sparse/0/images.txt"
    path.write_bytes(path.read_bytes().replace(b"rgb/1.png", os.fsencode(raw)))
    os.rename(model / "images/rgb/1.png", os.fsencode(model / "images" / raw))
    shutil.copy(model / "images/rgb/0.png", os.fsencode(model / "images/rgb") + b"/\xff.png")
    assert rows_of(read_capture(model), "photos") == [(7, 7, 0), (1, 0, 1)]
    assert cli.main(["info", str(model), "--json"]) == 0
    json.loads(capsys.readouterr().out)


def test_nothing_of_a_refused_capture_is_left_half_read(model):
    shutil.rmtree(model / "images")
    with pytest.raises(BadFile, match="none of its 7 photos is there"):
        read_capture(model)

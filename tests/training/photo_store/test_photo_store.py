"""Photos from a store are those of memory to the bit, whatever happens to its files."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.photo import has_alpha_channel, load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pinhole_of
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training import photos as training_photos
from shapeshift.training.first_anchors import first_anchors
from shapeshift.training.photo_store import photo_files
from shapeshift.training.photo_store.open_photos import PhotoRoom, TrainingPhotos, open_photos
from shapeshift.training.photo_store.photo_files import INDEX, MAGIC, PIXELS, RECORD
from shapeshift.training.photos import SAMPLE, LoadedPhoto, load_photos, memory_of, sampled
from shapeshift.training.schedule import Schedule
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer

SIZE = (40, 30)
RNG = np.random.default_rng
ONE = SIZE[0] * SIZE[1] * 4  # bytes of a photo


def capture_of(folder: Path, count: int = 20, bent: bool = False) -> Capture:
    """Photos of noise, of every kind: plain, with alpha, mask, depth, and normals beside the last
    two of these; the last two held out.
    """
    lens = ColmapCamera("SIMPLE_RADIAL", SIZE, (45.0, 20.0, 15.0, 0.1)) if bent else None
    size = SIZE if lens is None else pinhole_of(lens).size
    view = View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, size), 0.05, 100.0, size)
    mask, deep = folder / "mask.png", folder / "depth.png"
    Image.fromarray(RNG(1).integers(0, 256, SIZE[::-1], np.uint8)).save(mask)
    Image.fromarray(RNG(2).integers(0, 4000, SIZE[::-1], np.uint16)).save(deep)
    mapped, photos = folder / "normals.png", []
    ahead = RNG(3).integers((64, 64, 200), (192, 192, 256), (*SIZE[::-1], 3), np.uint8)
    Image.fromarray(ahead).save(mapped)
    for i in range(count):
        channels = 4 if i % 4 == 1 else 3
        path = folder / f"{i:03}.png"
        Image.fromarray(RNG(i).integers(0, 256, (*SIZE[::-1], channels), np.uint8)).save(path)
        more = {"mask": mask} if i % 4 == 2 else {"depth": deep} if i % 4 == 3 else {}
        more |= {"normals": mapped} if i % 8 > 5 else {}
        split = "test" if i >= count - 2 else "train"
        photos.append(Photo(view, path, "RGB", split=split, lens=lens, **more))
    return Capture(folder, (Stop("RGB", 0.0),), tuple(photos))


def stored(capture: Capture, room: int, factor: int = 1, masks: str = "object") -> TrainingPhotos:
    """From a store beside the capture, with so many bytes of memory."""
    photos = open_photos(capture, factor, masks, PhotoRoom(room, capture.folder / "a.photos"))
    assert photos.store is not None
    return photos


def assert_same(found: list[LoadedPhoto], wanted: list[LoadedPhoto]) -> None:
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        assert (a.view, a.modality, a.name) == (b.view, b.modality, b.name)
        assert (a.masked, a.see_through) == (b.masked, b.see_through)
        assert a.bytes == b.bytes
        assert a.kind == b.kind
        for name in ("rgba", "weight", "depth", "normals"):
            ours, own = getattr(a, name), getattr(b, name)
            assert (ours is None) == (own is None)
            if own is not None:
                assert ours.dtype == own.dtype
                np.testing.assert_array_equal(ours, own)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("masks", ["object", "valid", "ignore"])
@pytest.mark.parametrize("factor", [1, 3])
def test_a_photo_of_the_store_is_that_of_memory(tmp_path, bent, masks, factor):
    """To the bit: read from its file, from the window and from the disk, by two runs."""
    capture = capture_of(tmp_path, 20, bent)
    wanted = [p for split in ("train", "test") for p in load_photos(capture, split, factor, masks)]
    for run in range(2):
        photos = stored(capture, ONE, factor, masks)
        for _ in range(2):
            assert_same([*photos.train, *photos.test], wanted)
        assert photos.store.sources == (0 if run else 20)
        photos.close(keep=True)


@pytest.mark.parametrize("room", [0, ONE - 1, ONE, 2 * ONE - 1, 2 * ONE, 4 * ONE + 7])
def test_the_window_is_as_small_as_asked(tmp_path, room):
    """One photo stays in any case, else what is used right now would be read twice."""
    photos = stored(replace(capture := capture_of(tmp_path), photos=capture.photos[::4]), room)
    for i in (0, 1, 2, 3, 4, 0):
        photos.store.get(i)
        assert photos.store.bytes == sum(p.bytes for p in photos.store.window.values())
        assert photos.store.bytes <= max(room, ONE) and i in photos.store.window
    assert len(photos.store.window) == min(max(room // ONE, 1), 5)
    if room == 2 * ONE:
        assert list(photos.store.window) == [4, 0]  # used last


@pytest.mark.parametrize("what", ["newer", "bits", "short", "index", "magic", "other size"])
def test_what_is_stale_or_broken_is_made_anew(tmp_path, what):
    capture = capture_of(tmp_path)
    photos = stored(capture, ONE)
    assert_same(photos.train, load_photos(capture, "train", 1, "object"))
    photos.close(keep=True)
    folder, anew, factor = tmp_path / "a.photos", 1, 1
    if what == "newer":
        path = capture.photos[3].path
        before = os.stat(path).st_mtime_ns
        Image.fromarray(RNG(99).integers(0, 256, (*SIZE[::-1], 3), np.uint8)).save(path)
        os.utime(path, ns=(before + 1, before + 1))
    elif what == "bits":
        data = bytearray((folder / PIXELS).read_bytes())
        data[100] ^= 1
        (folder / PIXELS).write_bytes(data)
    elif what == "short":
        os.truncate(folder / PIXELS, 0)
        anew = 18
    elif what == "index":
        os.truncate(folder / INDEX, len(MAGIC) + 5 * RECORD.size + 3)
        anew = 18 - 5
    elif what == "magic":
        os.truncate(folder / INDEX, 0)
        anew = 18
    else:
        anew, factor = 18, 2
    photos = stored(capture, 1, factor)
    assert_same(photos.train, load_photos(capture, "train", factor, "object"))
    assert photos.store.sources == anew
    photos.close()
    assert not folder.exists()


def test_two_runs_at_once_have_a_folder_each(tmp_path):
    capture = capture_of(tmp_path)
    wanted, before = load_photos(capture, "train", 1, "object"), set(os.listdir(tmp_path))
    first, second = stored(capture, ONE), stored(capture, ONE)
    assert first.store.files.folder != second.store.files.folder
    assert_same(second.train, wanted)
    second.close()
    assert set(os.listdir(tmp_path)) - before == {"a.photos"}
    assert_same(first.train, wanted)
    first.close(keep=True)
    third = stored(capture, ONE)
    assert_same(third.train, wanted)
    assert third.store.sources == 0
    third.close()
    assert set(os.listdir(tmp_path)) == before


def test_a_folder_of_somebody_else_is_refused(tmp_path):
    capture, folder = capture_of(tmp_path), tmp_path / "a.photos"
    for make in (lambda: (folder / "mine.txt").write_text("x"),
                 lambda: (folder / INDEX).write_bytes(b"no index of ours"),
                 lambda: (folder / PIXELS).write_bytes(b"")):  # fmt: skip
        folder.mkdir()
        make()
        there = {p.name: p.read_bytes() for p in folder.iterdir()}
        with pytest.raises(BadFile, match=r"is in the way: .* move it, or name another --out"):
            stored(capture, 1)
        assert {p.name: p.read_bytes() for p in folder.iterdir()} == there
        shutil.rmtree(folder)
    (tmp_path / "elsewhere").mkdir()
    folder.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BadFile, match="is in the way"):
        stored(capture, 1)
    folder.unlink()
    folder.write_text("a file")
    with pytest.raises(BadFile, match="is in the way"):
        stored(capture, 1)


@pytest.mark.parametrize("over", [0, -1])
def test_a_disk_that_is_full_is_said_before_anything_is_read(tmp_path, monkeypatch, over):
    """At exactly the bytes that are needed it goes; what the store has already is not needed."""
    capture = capture_of(tmp_path)
    usage = shutil.disk_usage(tmp_path)
    free = memory_of(capture.photos, 1) + over
    monkeypatch.setattr(photo_files.shutil, "disk_usage", lambda _: usage._replace(free=free))
    if over:
        with pytest.raises(BadFile, match="on disk they need 1 MB where 1 MB are free; make room"):
            stored(capture, 1)
        assert not (tmp_path / "a.photos").exists()
    else:
        stored(capture, 1).close()


def test_a_disk_that_fills_up_later_only_costs_time(tmp_path, monkeypatch):
    capture = capture_of(tmp_path)
    photos = stored(capture, ONE)
    photos.store.get(0)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(photo_files, "write_at", full)
    assert not photos.trouble
    wanted = load_photos(capture, "train", 1, "object")
    for _ in range(2):
        assert_same(photos.train, wanted)
    assert "(No space left on device); they are read from the capture each time" in photos.trouble
    assert photos.store.sources > 18  # again and again
    photos.close()


def test_steps_find_their_photos_read(tmp_path):
    """What the schedule asks for is in the window or on its way, also for a second run and after a
    jump; photos are read once."""
    capture = capture_of(tmp_path)
    photos = stored(capture, 11 * 3 * ONE)
    assert photos.store.ahead == 5
    schedule = Schedule({"RGB": photos.train}, 0, (0.0, 0.0, 0.0))
    for start in (0, 0, 40):
        for future in list(photos.store.coming.values()):  # of the run before
            future.result()
        for i in range(start, start + 30):
            photos.read_ahead(schedule.photo, i)
            for later in range(i + 1, i + 6):
                number = schedule.photo(later).number
                # in this order: the thread moves it from the one to the other
                assert number in photos.store.coming or number in photos.store.window
            assert schedule.photo(i).rgba.shape == (30, 40, 4)
    assert photos.store.sources == 18 and 0 < photos.seconds(True) < 60
    photos.close()


def test_a_photo_that_cannot_be_read_says_so_when_its_turn_comes(tmp_path):
    """By whoever reads it: the thread's errors are those of the step."""
    capture = capture_of(tmp_path)
    photos = stored(capture, 10 * ONE)
    capture.photos[4].path.write_bytes(capture.photos[4].path.read_bytes()[:200])
    photos.store.fetch(4)
    for _ in range(2):
        with pytest.raises(BadFile, match=r"004\.png: the image is cut off"):
            photos.store.get(4)
    photos.close()


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "PA", "RGB", "RGBA", "I;16", "tRNS", "jpg"])
def test_the_header_tells_whether_there_is_an_alpha_channel(tmp_path, mode):
    """load_photo, which decodes the file, is the judge."""
    path = tmp_path / ("a.jpg" if mode == "jpg" else "a.png")
    grey, save = Image.fromarray(RNG(0).integers(0, 256, (6, 8), np.uint8)), {}
    if mode == "I;16":
        image = Image.fromarray(RNG(0).integers(0, 65536, (6, 8), np.uint16))
    elif mode == "PA":
        image, save = grey.convert("P"), {"transparency": 3}
    elif mode == "tRNS":
        image, save = grey.convert("RGB"), {"transparency": (1, 2, 3)}
    else:
        image = grey.convert({"jpg": "RGB"}.get(mode, mode))
    image.save(path, **save)
    view = View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, (8, 6)), 0.05, 100.0, (8, 6))
    photo = Photo(view, path, "RGB")
    assert has_alpha_channel(photo) == (load_photo(photo).mask is not None)


@pytest.mark.parametrize("count", [0, 1, SAMPLE, SAMPLE + 1, 1001])
def test_a_sample_is_everything_while_it_is_few(count):
    """As today up to SAMPLE photos a modality; then evenly, in their order."""
    pixels, view = np.zeros((1, 1, 4), np.uint8), None
    many = [LoadedPhoto(view, "RGB", pixels, None, str(i)) for i in range(count)]
    heat = [LoadedPhoto(view, "Heat", pixels, None, f"h{i}") for i in range(3)]
    mixed = [*heat[:1], *many, *heat[1:]]
    found = sampled(mixed)
    rows = [mixed.index(photo) for photo in found]
    assert rows == sorted(set(rows)) and all(photo in found for photo in heat)
    ours = [int(p.name) for p in found if p.modality == "RGB"]
    assert len(ours) == min(count, SAMPLE)
    if count <= SAMPLE:
        assert found == mixed
    else:
        steps = np.diff([*ours, count])
        assert ours[0] == 0 and steps.max() - steps.min() <= 1


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("balls")
    make_balls(folder, 32, 12, 2)
    return folder


def test_training_is_the_same_to_the_byte(device, balls):
    """All in memory, or two photos of them: two modalities, growing, exposures, guard and all."""
    settings = TrainSettings(iterations=120, max_anchors=150, grow_every=30)
    capture, files = read_capture(balls), []
    for most in (None, 2 * 32 * 32 * 4):
        trainer = Trainer(device, capture, settings, room=PhotoRoom(most))
        assert (trainer.photos.store is None) == (most is None)
        for _ in trainer.steps():
            pass
        assert trainer.elapsed >= 0
        files.append(package_files(trainer.model(), "float16"))
        assert trainer.held_out_psnr()
        trainer.photos.close()
    assert files[0] == files[1]


def words_of(capture: Path, out: Path) -> list[str]:
    words = ["train", str(capture), "--iterations", "60", "--max-anchors", "50"]
    return [*words, "--points", "random", "--out", str(out)]


def test_the_command_leaves_no_photos(balls, tmp_path, capsys):
    out, all_in_memory = tmp_path / "a.shift", tmp_path / "b.shift"
    for wrong in ("0", "-1", "nan", "inf"):
        assert cli.main([*words_of(balls, out), "--photo-mb", wrong]) == 2
        assert "expected MB above 0" in capsys.readouterr().err
    assert cli.main(words_of(balls, all_in_memory)) == 0
    assert "read as they are needed" not in capsys.readouterr().err
    assert cli.main([*words_of(balls, out), "--photo-mb", "0.02"]) == 0
    assert "they are read as they are needed" in " ".join(capsys.readouterr().err.split())
    assert out.read_bytes() == all_in_memory.read_bytes()
    names = ("a.shift", "b.shift", "a.shift.checkpoint.npz", "b.shift.checkpoint.npz")
    assert set(os.listdir(tmp_path)) == set(names)


def test_a_photo_that_breaks_on_the_way_costs_no_work(balls, tmp_path, capsys, monkeypatch):
    """Where photos are many, not all are looked at before the first step.

    What was learned is kept, one sentence says why; with the photo mended, --resume goes on from
    the photos that lie there already, and ends as a run without a fault does.
    """
    monkeypatch.setattr(training_photos, "SAMPLE", 2)
    monkeypatch.setattr(first_anchors, "COLOR_PHOTOS", 2)
    capture, out, good = tmp_path / "capture", tmp_path / "a.shift", tmp_path / "b.shift"
    shutil.copytree(balls, capture)
    assert cli.main(words_of(capture, good)) == 0
    split = load_photos(read_capture(capture), "train", 1, "object")
    lists = {p.modality: [q for q in split if q.modality == p.modality] for p in split}
    looked = {p.name for each in lists.values() for p in (each[0], each[6], each[-1])}
    turns = [Schedule(lists, 0, None).photo(i).name for i in range(len(split))]
    steps = max(turns.index(p.name) for p in split if p.name not in looked)
    broken = Path(turns[steps])
    whole, state = broken.read_bytes(), os.stat(broken)
    broken.write_bytes(whole[: len(whole) // 2])
    capsys.readouterr()
    assert cli.main([*words_of(capture, out), "--photo-mb", "0.02"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"{broken}: the image is cut off" in said and "Traceback" not in said
    assert f"after {steps} steps is in {out}; when the photo is mended, --resume" in said
    assert out.exists() and (tmp_path / "a.shift.photos").exists()
    broken.write_bytes(whole)
    os.utime(broken, ns=(state.st_atime_ns, state.st_mtime_ns))
    again = ["train", str(capture), "--out", str(out), "--resume", "--photo-mb", "0.02"]
    assert cli.main([*again, "--iterations", "60"]) == 0
    assert out.read_bytes() == good.read_bytes()
    assert not (tmp_path / "a.shift.photos").exists()

"""A recording of the left eye: which frames it keeps, in how much memory and on how much disk."""

import threading

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.cli import main
from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.errors import UsageError
from shapeshift.app.headset.session import recorder
from shapeshift.app.headset.session.recorder import MOST_WAITING, TIMES, Recorder

SIZE = (6, 4)  # width, height


@pytest.fixture(autouse=True)
def pictures(monkeypatch):
    """A framebuffer is what is read from it."""
    monkeypatch.setattr(recorder, "read_color", lambda picture: picture)


def picture(shade: float) -> np.ndarray:
    return np.full((SIZE[1], SIZE[0], 3), shade, np.float32)


def record(made: Recorder, times: list[float], messages: Messages) -> None:
    for seen_s in times:
        made.saw(seen_s, picture(seen_s))
        for done in made.writing:
            done.exception()  # waits: each is written before the next is seen
        made.poll(messages, 0.0)


def test_frames_are_kept_at_the_rate_and_numbered(tmp_path):
    made, messages = Recorder(tmp_path, rate=10.0), Messages()
    made.start(tmp_path / "new")
    record(made, [5 + i / 90 for i in range(91)], messages)  # a second and its end
    made.stop(messages, 0.0)
    made.close()
    files = sorted((tmp_path / "new").glob("*.png"))
    assert [path.name for path in files] == [f"{i:05d}.png" for i in range(11)]
    with Image.open(files[3]) as image:
        assert image.size == SIZE
    rows = (tmp_path / "new" / TIMES).read_text().splitlines()
    assert rows[0] == "frame,seconds" and len(rows) == 12
    seconds = [float(row.split(",")[1]) for row in rows[1:]]
    # The first frame at or after each tenth of a second.
    np.testing.assert_allclose(seconds, np.ceil(np.arange(11) * 9) / 90, atol=6e-4)
    assert messages.note == "new: 11 frames are written."


def test_late_frames_are_no_reason_to_keep_more_of_them(tmp_path):
    made = Recorder(tmp_path, rate=10.0)
    made.start(tmp_path / "new")
    record(made, [0.0, 0.5, 0.51, 0.52, 0.6], Messages())
    assert made.count == 3
    made.close()


def test_a_disk_that_is_too_slow_holds_few_frames_in_memory(tmp_path, monkeypatch):
    goes_on = threading.Event()
    monkeypatch.setattr(recorder, "write_frame", lambda pixels, path: goes_on.wait(60) and 1)
    made = Recorder(tmp_path, rate=10.0)
    made.start(tmp_path / "new")
    for i in range(MOST_WAITING + 5):
        made.saw(i / 10, picture(0.5))
        made.poll(Messages(), 0.0)
    assert (made.count, made.left_out) == (MOST_WAITING, 5)
    goes_on.set()
    made.close()


def test_it_ends_at_so_many_bytes(tmp_path):
    made, messages = Recorder(tmp_path, most_bytes=1), Messages()
    made.start(tmp_path / "new")
    record(made, [0.0, 1.0, 2.0], messages)
    assert not made.recording and made.count == 1
    assert messages.note == "new: 1 frames are written."
    made.close()


def test_a_folder_that_cannot_be_written_ends_it_with_a_sentence(tmp_path, monkeypatch):
    def full(pixels, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder, "write_frame", full)
    made, messages = Recorder(tmp_path), Messages()
    made.start(tmp_path / "new")
    record(made, [0.0], messages)
    assert not made.recording
    assert messages.problems == ["The recording cannot be written: No space left on device."]
    made.close()


def test_the_button_begins_and_ends_in_folders_of_their_own(tmp_path):
    made, messages = Recorder(tmp_path), Messages()
    for number in (1, 2):
        made.toggle(messages, 0.0)
        assert made.folder == tmp_path / f"recording-{number:03d}"
        made.toggle(messages, 0.0)
        assert not made.recording
    made.close()


def test_what_lies_in_a_folder_stays(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    made = Recorder(tmp_path)
    with pytest.raises(UsageError, match="is not empty; choose another folder for --record"):
        made.start(tmp_path)
    made.close()


@pytest.mark.parametrize("rate", ["0", "121", "nan"])
def test_a_rate_that_is_none_is_one_sentence(capsys, rate):
    assert main(["vr", "--record-rate", rate]) == 2
    said = capsys.readouterr().err
    assert "--record-rate is" in said and said.count("\n") == 1

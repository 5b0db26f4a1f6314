"""A 3D mouse in the real window, by packets of a spacenavd that the test plays."""

import socket
import struct
import time

import numpy as np
import pytest

from shapeshift.app.editor.state.camera.camera import FIRST
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.window.devices import space_mice
from shapeshift.app.editor.window.devices.space_mice import SpaceNavigation
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.desktop.objects_stand import release, viewer_of


@pytest.fixture
def daemon(tmp_path):
    """A listening socket, at the path that it is bound to."""
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listening.bind(str(tmp_path / "spnav.sock"))
    listening.listen()
    yield listening
    listening.close()


def packet(kind: int, *values: int) -> bytes:
    return struct.pack("=8i", kind, *values, *[0] * (7 - len(values)))


def test_packets_in_any_pieces(daemon, monkeypatch):
    mouse = SpaceNavigation((daemon.getsockname(),))
    assert mouse.read() == space_mice.CapState()  # connected, at rest
    sent, _ = daemon.accept()
    data = packet(0, 35, -70, 350, 0, 7, 0, 16) + packet(1, 1) + packet(1, 99) + packet(2, 1)
    data += packet(1, 0) + packet(9, 1, 2, 3)  # of a newer program: passed over
    for at in range(0, len(data), 5):
        sent.sendall(data[at : at + 5])
        cap = mouse.read()
    assert (cap.right, cap.up, cap.ahead, cap.about_up) == (0.1, -0.2, 1.0, 0.02)
    assert cap.pressed == {0}
    sent.sendall(packet(1, 1) + packet(2, 1))
    assert mouse.read().pressed == {0, 1} and mouse.read().pressed == {0}  # a quick press is seen
    sent.sendall(packet(0))
    assert mouse.read() == space_mice.CapState(pressed=frozenset({0}))
    sent.close()
    assert mouse.read() is None  # the program has ended
    assert mouse.read() is None  # it is not looked for in every frame
    later = time.monotonic() + space_mice.AGAIN_S
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert mouse.read() == space_mice.CapState()
    mouse.close()


def test_without_such_a_program_nobody_waits(tmp_path):
    mouse = SpaceNavigation((str(tmp_path / "none"),))
    assert mouse.read() is None and mouse.read() is None


def test_a_cap_moves_the_scene_and_the_eye(window, tmp_path, daemon, monkeypatch):
    monkeypatch.setenv("SPNAV_SOCKET", daemon.getsockname())
    viewer = viewer_of(window, OpenedFiles((Source(tmp_path / "ball.ply", ball()),)), tmp_path)
    mice, camera = viewer.devices.mice, viewer.viewpoint.camera
    run_frames(viewer, 2)
    assert mice.connected and not mice.input.moving
    sent, _ = daemon.accept()
    middle, distance = camera.target, camera.distance
    sent.sendall(packet(0, 0, 0, 350))  # pushed away
    run_frames(viewer, 10)
    assert camera.distance > 1.05 * distance and np.allclose(camera.target, middle)
    sent.sendall(packet(0))
    run_frames(viewer, 20)
    assert not viewer.devices.moving
    camera.toggle_flying()
    eye, ahead = camera.position, -camera.view((10, 10)).world_from_eye.matrix()[:3, 2]
    sent.sendall(packet(0, 0, 0, 350))
    run_frames(viewer, 10)
    moved = camera.position - eye
    assert moved @ ahead > 0.99 * np.linalg.norm(moved) > 0
    sent.sendall(packet(0) + packet(1, 1) + packet(2, 1))  # a press between two frames acts
    run_frames(viewer, 60)
    assert camera.framed == FIRST and np.linalg.norm(camera.position - eye) > 0.1 * distance
    sent.close()
    release(viewer)

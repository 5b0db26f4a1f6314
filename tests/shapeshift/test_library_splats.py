"""Splats of one's own in `import shapeshift as ss`, and pictures from any thread and process."""

import multiprocessing
import os
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import shapeshift as ss


@pytest.fixture(scope="module")
def scene() -> ss.Scene:
    return ss.Scene.from_splats(ss.PlainSplats.from_raw(**raw_parameters()))


def raw_parameters(count: int = 5) -> dict[str, np.ndarray]:
    """As 3DGS and gsplat train them."""
    rng = np.random.default_rng(3)
    return {
        "means": rng.normal(size=(count, 3)), "scales": rng.normal(-4, 0.5, (count, 3)),
        "wxyz": rng.normal(size=(count, 4)), "opacity": rng.normal(size=(count, 1)),
        "sh": rng.normal(size=(count, 4, 3)),
    }  # fmt: skip


def test_raw_parameters_become_splats(tmp_path):
    """Beside the formulas written anew, and beside a 3DGS file of the same numbers."""
    raw = raw_parameters()
    splats = ss.PlainSplats.from_raw(**raw)
    np.testing.assert_allclose(splats.scales, np.exp(raw["scales"]), rtol=1e-6)
    np.testing.assert_allclose(splats.opacity, 1 / (1 + np.exp(-raw["opacity"][:, 0])), rtol=1e-5)
    length = np.linalg.norm(raw["wxyz"], axis=1, keepdims=True)
    np.testing.assert_allclose(splats.wxyz, raw["wxyz"] / length, atol=1e-6)
    np.testing.assert_array_equal(splats.means, raw["means"].astype(np.float32))
    names = [
        "x", "y", "z", *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(9)),
        "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4)),
    ]  # fmt: skip
    rest = raw["sh"][:, 1:].transpose(0, 2, 1).reshape(-1, 9)
    rows = np.hstack(
        [raw["means"], raw["sh"][:, 0], rest, raw["opacity"], raw["scales"], raw["wxyz"]]
    )
    head = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}",
         *(f"property float {name}" for name in names), "end_header\n"]
    )  # fmt: skip
    file = tmp_path / "raw.ply"
    file.write_bytes(head.encode() + rows.astype("<f4").tobytes())
    read = ss.load(file, up="+Y").splats(0)
    for name in ("means", "scales", "opacity", "sh", "wxyz"):
        np.testing.assert_allclose(getattr(splats, name), getattr(read, name), atol=2e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"scales": np.full((5, 3), -4.0)}, r"scales is -4 at \[0, 0\]; metres .*from_raw"),
        ({"opacity": np.array([0, 1, 1.001, 0.5, 0.5])}, r"opacity is 1.001 at \[2\]; 0 to 1"),
        ({"opacity": np.array([0, 1, -1e-3, 0.5, 0.5])}, r"opacity is -0.001 at \[2\]"),
        ({"wxyz": np.zeros((5, 4))}, r"wxyz has length 0 at \[0\]; length 1 .*from_raw"),
        ({"wxyz": np.tile([1.01, 0, 0, 0], (5, 1))}, "wxyz has length 1.01"),
        ({"scales": np.full((5, 3), np.nan)}, "scales has 15 NaN or Inf"),
        ({"means": [[0, 0]] * 5}, r"means has shape \(5, 2\)"),
    ],
)
def test_splats_that_are_still_coded_are_refused(change, said):
    splats = ss.PlainSplats.from_raw(**raw_parameters())
    with pytest.raises(ValueError, match=said):
        ss.Scene.from_splats(replace(splats, **change))


def test_what_no_splats_can_be_made_of():
    raw = raw_parameters()
    for change, said in (
        ({"wxyz": np.zeros((5, 4))}, "row 0 is no splat"),
        ({"scales": np.full((5, 3), 89.0)}, "row 0 is no splat"),  # exp of 88.7 is float32's last
        ({"sh": np.zeros((5, 5, 3))}, r"sh has shape \(5, 5, 3\)"),
        ({"opacity": np.zeros((5, 2))}, r"opacity has shape \(5, 2\)"),
    ):
        with pytest.raises(ValueError, match=said):
            ss.PlainSplats.from_raw(**(raw | change))


def test_lists_and_float64_are_taken_and_splats_travel():
    splats = ss.PlainSplats.from_raw(**raw_parameters())
    arrays = ("means", "scales", "wxyz", "opacity", "sh")
    lists = replace(splats, **{name: getattr(splats, name).tolist() for name in arrays})
    scene, same = ss.Scene.from_splats(splats), ss.Scene.from_splats(lists)
    again = pickle.loads(pickle.dumps(scene.splats(0)))
    for name in arrays:
        np.testing.assert_array_equal(getattr(same.splats(0), name), getattr(scene.splats(0), name))
        np.testing.assert_array_equal(getattr(again, name), getattr(scene.splats(0), name))


def test_pictures_from_any_thread(scene):
    """In turn by four threads, the first of which ends; by scenes and by one renderer."""
    size = (32, 18)
    wanted = np.asarray(scene.render(size=size))
    with ss.Renderer() as renderer:
        view = scene.views("orbit", 1, size)[0]
        first = renderer.render(scene, view).copy()

        def draw(number: int) -> bool:
            if number % 2:
                return np.array_equal(renderer.render(scene, view), first)
            return np.array_equal(np.asarray(scene.render(size=size)), wanted)

        alone = threading.Thread(target=draw, args=(0,))
        alone.start()
        alone.join()
        with ThreadPoolExecutor(4) as pool:
            assert all(pool.map(draw, range(24)))
    assert np.array_equal(np.asarray(scene.render(size=size)), wanted)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_process_is_told_at_once(scene):
    """Its parent has drawn; the drivers' threads are not in it, and it would wait for them."""
    scene.render(size=(32, 18))
    parent, child = multiprocessing.get_context("fork").Pipe()

    def draw() -> None:
        try:
            scene.render(size=(32, 18))
        except ss.NoDevice as error:
            child.send(str(error))

    process = multiprocessing.get_context("fork").Process(target=draw)
    process.start()
    assert parent.poll(20), "it waits for ever"
    assert "get_context('spawn')" in parent.recv()
    process.join(20)
    assert process.exitcode == 0

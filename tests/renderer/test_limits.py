"""Scenes that a device cannot hold: one sentence with the limit, what fits and what to do."""

from dataclasses import dataclass

import numpy as np
import pytest

from shapeshift.rasterizer.device import Device, NoMemory
from shapeshift.rasterizer.project import RECORD
from shapeshift.renderer.limits import MOST_INDEX, TooLarge, check_tiles
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from tests.support.splat_scenes import random_layers


@dataclass
class Counted:
    """A model of so many splats that it is better not made."""

    splat_count: int


@dataclass
class Told:
    """A device that says how long an array may be."""

    most_bytes: int


def test_harmonics_are_the_longest_array_of_a_scene_of_degree_3():
    layers = random_layers(100, coefficients=16)
    check_tiles(Told(100 * 192), [layers])
    with pytest.raises(TooLarge) as refusal:
        check_tiles(Told(100 * 192 - 1), [layers])
    said = str(refusal.value)
    assert "has 100 splats" in said and "99 at most" in said and "--max-splats 99 " in said
    assert "CL_DEVICE_MAX_MEM_ALLOC_SIZE is 19,199 bytes, a splat takes 192" in said
    assert "--drawing quads" in said and "\n" not in said


def test_without_harmonics_it_is_the_record():
    check_tiles(Told(4 * RECORD * 7), [Counted(3), Counted(4)])
    with pytest.raises(TooLarge, match=r"has 8 splats .* 7 at most"):
        check_tiles(Told(4 * RECORD * 7), [Counted(4), Counted(4)])


def test_a_driver_that_says_nothing_has_the_limit_of_the_kernels_alone():
    most = MOST_INDEX // RECORD
    check_tiles(Told(0), [Counted(most)])
    check_tiles(Told(0), [])
    with pytest.raises(TooLarge, match=r"draws 178,956,970 at most \(the kernels count"):
        check_tiles(Told(0), [Counted(most + 1)])


def test_a_device_whose_memory_is_full_says_so_in_one_sentence(monkeypatch):
    cl = pytest.importorskip("pyopencl")

    def full(*_, **__):
        raise cl.MemoryError("clCreateBuffer", -4, "")

    monkeypatch.setattr("pyopencl.array.Array", full)
    device = Device(None, None, "a card", "a platform", "gpu", 1, None)
    with pytest.raises(NoMemory, match="a card has no room for 4,000 bytes more; open the scene"):
        device.empty((10, 100), np.float32)


def test_a_machine_whose_memory_is_full_says_so_in_one_sentence(tmp_path, monkeypatch):
    def full(*_):
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr("shapeshift.runtime_models.read_scene.read_whole", full)
    with pytest.raises(BadFile, match=r"big\.ply does not fit this machine's memory"):
        read_model(tmp_path / "big.ply")

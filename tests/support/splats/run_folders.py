"""Folders that gsplat and nerfstudio leave: checkpoints with settings, splats in PNG pictures."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from tests.support.splats.torch_files import write_tensors

NERFSTUDIO = "pipeline._model.gauss_params"
CFG = """!!python/object:__main__.Config
antialiased: {antialiased}
normalize_world_space: {normal}
strategy: !!python/object/apply:os.system
- touch owned
"""
CONFIG = """!!python/object:nerfstudio.engine.trainer.TrainerConfig
pipeline: !!python/object:nerfstudio.pipelines.base_pipeline.VanillaPipelineConfig
  model: !!python/object:nerfstudio.models.splatfacto.SplatfactoModelConfig
    rasterize_mode: {mode}
    sh_degree: 3
"""


def arrays_of(count: int = 60, rest: int = 15, seed: int = 0) -> dict[str, np.ndarray]:
    """Splats as both trainers code them, by gsplat's names."""
    rng = np.random.default_rng(seed)
    arrays = {
        "means": rng.normal(size=(count, 3)), "scales": rng.uniform(-5, -2, (count, 3)),
        "quats": rng.normal(size=(count, 4)), "opacities": rng.normal(size=count),
        "sh0": rng.normal(size=(count, 1, 3)), "shN": 0.2 * rng.normal(size=(count, rest, 3)),
    }  # fmt: skip
    return {name: array.astype(np.float32) for name, array in arrays.items()}


def write_gsplat_run(
    folder: Path, parts: list[dict], step: int = 29999, antialiased="false", normal="true"
) -> Path:
    """results/ with cfg.yml and a checkpoint for each card."""
    (folder / "ckpts").mkdir(parents=True, exist_ok=True)
    for rank, arrays in enumerate(parts):
        named = {f"splats.{name}": array for name, array in arrays.items()}
        write_tensors(folder / "ckpts" / f"ckpt_{step}_rank{rank}.pt", named)
    (folder / "cfg.yml").write_text(CFG.format(antialiased=antialiased, normal=normal))
    return folder


def write_nerfstudio_run(outputs: Path, arrays: dict, mode: str, time: str = "0001") -> Path:
    """outputs/hall/splatfacto/TIME with config.yml and a checkpoint."""
    run = outputs / "hall" / "splatfacto" / time
    (run / "nerfstudio_models").mkdir(parents=True)
    names = {"sh0": "features_dc", "shN": "features_rest"}
    named = {f"{NERFSTUDIO}.{names.get(n, n)}": array for n, array in arrays.items()}
    named[f"{NERFSTUDIO}.features_dc"] = arrays["sh0"][:, 0]
    named[f"{NERFSTUDIO}.opacities"] = arrays["opacities"][:, None]
    write_tensors(run / "nerfstudio_models" / "step-000029999.ckpt", named)
    (run / "config.yml").write_text(CONFIG.format(mode=mode))
    return run


def write_png_folder(folder: Path, arrays: dict, sets: int = 8) -> dict[str, np.ndarray]:
    """The folder that gsplat's PNG compression writes; what its own reader gives of it.

    As many splats as a square has; the first `sets` rows of shN are the sets of harmonics.
    """
    folder.mkdir(parents=True)
    count = len(arrays["means"])
    side = int(count**0.5)
    assert side * side == count
    meta, back = {}, {}
    arrays = dict(arrays)
    arrays["quats"] = arrays["quats"] / np.linalg.norm(arrays["quats"], axis=1, keepdims=True)
    for name in ("means", "scales", "quats", "opacities", "sh0"):
        values = arrays[name].reshape(count, -1).astype(np.float64)
        if name == "means":
            values = np.sign(values) * np.log1p(np.abs(values))
        low, high = values.min(axis=0), values.max(axis=0)
        most = 65535 if name == "means" else 255
        codes = np.rint((values - low) / (high - low) * most).astype(np.uint16)
        grid = codes.reshape(side, side, -1).squeeze()
        if name == "means":
            Image.fromarray((grid & 255).astype(np.uint8)).save(folder / "means_l.png")
            Image.fromarray((grid >> 8).astype(np.uint8)).save(folder / "means_u.png")
        else:
            Image.fromarray(grid.astype(np.uint8)).save(folder / f"{name}.png")
        meta[name] = {"shape": list(arrays[name].shape), "dtype": "float32",
                      "mins": low.tolist(), "maxs": high.tolist()}  # fmt: skip
        got = codes / most * (high - low) + low
        back[name] = np.sign(got) * np.expm1(np.abs(got)) if name == "means" else got
    rest = arrays["shN"]
    flat = rest.reshape(count, -1)
    low, high = float(flat[:sets].min()), float(flat[:sets].max())
    centroids = np.rint((flat[:sets] - low) / (high - low) * 63).astype(np.uint8)
    labels = (np.arange(count) % sets).astype(np.uint16)
    np.savez_compressed(folder / "shN.npz", centroids=centroids, labels=labels)
    meta["shN"] = {"shape": list(rest.shape), "dtype": "float32", "mins": low, "maxs": high,
                   "quantization": 6}  # fmt: skip
    back["shN"] = (centroids / 63 * (high - low) + low)[labels].reshape(rest.shape)
    (folder / "meta.json").write_text(json.dumps(meta))
    return back

"""Networks with the inputs and outputs of SAM's exports that answer with a disc at the click.

They say whether a place goes to the network and comes back right, and nothing of real weights.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto as T
from onnx import helper as h
from onnx import numpy_helper

SURE = 0.9  # score of every answer


def info(name: str, kind: int, shape: list) -> onnx.ValueInfoProto:
    return h.make_tensor_value_info(name, kind, shape)


def write(path: Path, nodes: list, inputs: list, outputs: list, constants: dict) -> None:
    made = [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    graph = h.make_graph(nodes, "stand_in", inputs, outputs, made)
    onnx.save(h.make_model(graph, opset_imports=[h.make_opsetid("", 17)], ir_version=8), path)


def passed_on(path: Path, entry: str, shape: list, names: list[str], kind: int = T.FLOAT) -> None:
    """An image encoder whose every output is its input."""
    nodes = [h.make_node("Identity", [entry], [name]) for name in names]
    write(path, nodes, [info(entry, kind, shape)], [info(n, kind, shape) for n in names], {})


def disc(side: int, low: int, radius: float) -> tuple[list, dict]:
    """Nodes from "place" (1, 2, 1, 1), pixels of the square, to "disc" (1, 1, low, low) logits."""
    y, x = (np.mgrid[:low, :low].astype(np.float32) + 0.5) * side / low
    nodes = [
        h.make_node("Sub", ["grid", "place"], ["d"]), h.make_node("Mul", ["d", "d"], ["dd"]),
        h.make_node("ReduceSum", ["dd", "one"], ["r2"], keepdims=1),
        h.make_node("Sub", ["limit", "r2"], ["disc"]),
    ]  # fmt: skip
    return nodes, {
        "grid": np.stack([x, y])[None],
        "one": np.array([1], np.int64), "zero": np.array([0], np.int64),
        "limit": np.full((1, 1, 1, 1), radius**2, np.float32),
        "to": np.array([1, 2, 1, 1], np.int64),
    }  # fmt: skip


def write_sam(folder: Path, kind: str, side: int = 256, spoil: str = "") -> float:
    """A stand-in of SAM ("sam", with an encoder that takes bytes as rows: "sam rows") or SAM 2.

    spoil: "nan", "scores", "rank", "names": what is wrong with the answers.  Gives the radius of
    the disc, in pixels of the square.
    """
    low, radius = side // 4, side / 8
    second = kind == "sam 2"
    names = (
        ["high_res_feats_0", "high_res_feats_1", "image_embed"] if second else ["image_embeddings"]
    )
    shape = ["h", "w", 3] if kind == "sam rows" else [1, 3, side, side]
    passed_on(folder / "a.encoder.onnx", "image", shape, names)
    nodes, constants = disc(side, low, radius)
    out = "scaled" if spoil else "masks"
    nodes = [
        h.make_node("Slice", ["point_coords", "zero", "one", "one"], ["first"]),
        h.make_node("Reshape", ["first", "to"], ["place"]), *nodes,
        h.make_node("Identity", ["disc"], [out]),
        h.make_node("Identity", ["sure"], ["iou_predictions"]),
    ]  # fmt: skip
    constants["sure"] = np.array([[SURE]], np.float32)
    shapes, sure = [1, 1, low, low], [1, 1]
    if spoil == "nan":
        nodes.append(h.make_node("Mul", ["scaled", "nan"], ["masks"]))
        constants["nan"] = np.float32(np.nan)
    elif spoil == "rank":
        nodes.append(h.make_node("Reshape", ["scaled", "flat"], ["masks"]))
        constants["flat"], shapes = np.array([-1], np.int64), [low * low]
    elif spoil == "scores":
        nodes.append(h.make_node("Identity", ["scaled"], ["masks"]))
        constants["sure"], sure = np.array([[SURE, 0.2]], np.float32), [1, 2]
    named = "answers" if spoil == "names" else "masks"
    if spoil == "names":
        nodes.append(h.make_node("Identity", ["scaled"], ["answers"]))
    inputs = [info(n, T.FLOAT, shape) for n in names]
    inputs += [
        info("point_coords", T.FLOAT, [1, "n", 2]), info("point_labels", T.FLOAT, [1, "n"]),
        info("mask_input", T.FLOAT, [1, 1, low, low]), info("has_mask_input", T.FLOAT, [1]),
    ]  # fmt: skip
    inputs += [] if second else [info("orig_im_size", T.FLOAT, [2])]
    outputs = [info(named, T.FLOAT, shapes), info("iou_predictions", T.FLOAT, sure)]
    write(folder / "a.decoder.onnx", nodes, inputs, outputs, constants)
    return radius


def write_transformers(folder: Path, third: bool, boxes: bool) -> None:
    """The files of Transformers' exports; the disc is at the click, or in the box's middle."""
    side, low, radius = (1008, 288, 126.0) if third else (1024, 256, 128.0)
    names = ["image_embeddings", "image_positional_embeddings"]
    if boxes:
        names = [f"image_embeddings.{i}" for i in range(3)]
    sizes = [low >> i for i in range(len(names))] if boxes else [low // 4] * 2
    ends = {f"end{i}": np.array([n, n], np.int64) for i, n in enumerate(sizes)}
    write(
        folder / "vision_encoder.onnx",
        [h.make_node("Slice", ["pixel_values", "start", f"end{i}", "axes"], [name])
         for i, name in enumerate(names)],
        [info("pixel_values", T.FLOAT, [1, 3, "h", "w"])],
        [info(name, T.FLOAT, [1, 3, n, n]) for name, n in zip(names, sizes, strict=True)],
        ends | {"start": np.array([0, 0], np.int64), "axes": np.array([2, 3], np.int64)},
    )  # fmt: skip
    nodes, constants = disc(side, low, radius)
    entry = "box" if boxes else "input_points"
    nodes = [
        h.make_node("ReduceMean", [entry], ["mean"], axes=[2], keepdims=1),
        h.make_node("Reshape", ["mean", "to"], ["place"]), *nodes,
        h.make_node("Unsqueeze", ["disc", "one"], ["pred_masks"]),
        h.make_node("Identity", ["sure"], ["iou_scores"]),
    ]  # fmt: skip
    constants["sure"] = np.array([[[SURE]]], np.float32)
    inputs = [info(n, T.FLOAT, [1, 3, s, s]) for n, s in zip(names, sizes, strict=True)]
    if boxes:
        inputs.append(info("input_boxes", T.FLOAT, [1, "b", 4]))
        nodes.insert(0, h.make_node("Reshape", ["input_boxes", "corners"], ["box"]))
        constants["corners"] = np.array([1, 1, 2, 2], np.int64)
    inputs.append(info("input_points", T.FLOAT, [1, 1, "n", 2]))
    inputs.append(info("input_labels", T.INT64, [1, 1, "n"]))
    outputs = [
        info("pred_masks", T.FLOAT, [1, 1, 1, low, low]), info("iou_scores", T.FLOAT, [1, 1, 1])
    ]  # fmt: skip
    write(folder / "prompt_encoder_mask_decoder.onnx", nodes, inputs, outputs, constants)


def write_sam3(folder: Path, raw: bool = True, room: int | None = None) -> None:
    """samexporter's SAM 3: the disc is in the middle of the first box; with `raw` the network gives
    what it thinks, else masks in the photo's size.  Its score is that of the text's third token
    over 100.
    """
    side, low = 112, 32
    names = [f"vision_pos_enc_{i}" for i in range(3)] + [f"backbone_fpn_{i}" for i in range(3)]
    passed_on(folder / "sam3_image_encoder.onnx", "image", [3, side, side], names, T.UINT8)
    write(
        folder / "sam3_language_encoder.onnx",
        [h.make_node("Cast", ["tokens"], ["text_attention_mask"], to=T.BOOL),
         h.make_node("Cast", ["tokens"], ["text_memory"], to=T.FLOAT),
         h.make_node("Cast", ["tokens"], ["text_embeds"], to=T.FLOAT)],
        [info("tokens", T.INT64, [1, 32])],
        [info("text_attention_mask", T.BOOL, [1, 32]), info("text_memory", T.FLOAT, [1, 32]),
         info("text_embeds", T.FLOAT, [1, 32])],
        {},
    )  # fmt: skip
    nodes, constants = disc(1, low, 0.125)
    nodes = [
        h.make_node("Slice", ["box_coords", "zero", "one", "zero"], ["row"]),
        h.make_node("Slice", ["row", "zero", "two", "axis"], ["first"]),
        h.make_node("Reshape", ["first", "to"], ["place"]), *nodes,
        h.make_node("Slice", ["language_features", "one", "two", "one"], ["token"]),
        h.make_node("Div", ["token", "hundred"], ["score"]),
    ]  # fmt: skip
    constants |= {
        "two": np.array([2], np.int64),
        "axis": np.array([2], np.int64),
        "hundred": np.float32(100),
    }
    inputs = [
        info("original_height", T.INT64, []), info("original_width", T.INT64, []),
        *(info(n, T.UINT8, [3, side, side]) for n in names if raw or "fpn" in n),
        info("language_mask", T.BOOL, [1, 32]), info("language_features", T.FLOAT, [1, 32]),
        info("language_embeds", T.FLOAT, [1, 32]), info("box_coords", T.FLOAT, [room or "n", 1, 4]),
        info("box_labels", T.INT64, [room or "n", 1]), info("box_masks", T.BOOL, [1, room or "n"]),
    ]  # fmt: skip
    if raw:
        nodes += [
            h.make_node("Reshape", ["score", "logits"], ["pred_logits"]),
            h.make_node("Identity", ["high"], ["presence_logit_dec"]),
            h.make_node("Identity", ["disc"], ["pred_masks"]),
        ]
        constants |= {"logits": np.array([1, 1, 1], np.int64), "high": np.array([[80]], np.float32)}
        outputs = [
            info("pred_logits", T.FLOAT, [1, 1, 1]), info("presence_logit_dec", T.FLOAT, [1, 1]),
            info("pred_masks", T.FLOAT, [1, 1, low, low]),
        ]  # fmt: skip
    else:
        nodes += [
            h.make_node("Greater", ["disc", "nought"], ["masks"]),
            h.make_node("Reshape", ["score", "logits"], ["scores"]),
            h.make_node("Identity", ["nowhere"], ["boxes"]),
        ]
        constants |= {"logits": np.array([1], np.int64), "nought": np.float32(0),
                      "nowhere": np.zeros((1, 4), np.float32)}  # fmt: skip
        outputs = [
            info("boxes", T.FLOAT, [1, 4]), info("scores", T.FLOAT, [1]),
            info("masks", T.BOOL, [1, 1, low, low]),
        ]  # fmt: skip
    write(folder / "sam3_decoder.onnx", nodes, inputs, outputs, constants)


def write_words(folder: Path) -> None:
    """A vocabulary of a few merges."""
    rows = ["#version: 0.2", "m u", "mu g</w>", "c a", "ca n</w>"]
    (folder / "merges.txt").write_text("\n".join(rows) + "\n")

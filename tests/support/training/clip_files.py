"""A made CLIP in a folder, as exporters write one, that knows nothing but four colours.

Its vision tower sees the mean colour of a picture, its text tower knows words of colours; so what
comes of a text is known.  A second one has a real vision transformer for its gradients.
"""

import json

import numpy as np

from shapeshift.training.style_features.clip_model import END, START, WORD_END, byte_letters
from tests.support.training.onnx_files import vision_transformer, write_model

COLORS = {"red": (1, 0.1, 0.1), "lime": (0.1, 1, 0.1), "blue": (0.1, 0.1, 1)}
GREY = (0.6, 0.6, 0.6)


def tokenizer(words=tuple(COLORS)) -> dict:
    """A tokenizer.json of all bytes, alone and at a word's end, and of some whole words."""
    letters = byte_letters()
    tokens = [*letters, *(letter + WORD_END for letter in letters)]
    merges = []
    for word in words:
        parts = [*word[:-1], word[-1] + WORD_END]
        while len(parts) > 1:
            pair, parts = (parts[0], parts[1]), [parts[0] + parts[1], *parts[2:]]
            if " ".join(pair) not in merges:
                merges.append(" ".join(pair))
                tokens.append(parts[0])
    tokens += [START, END]
    vocab = {token: i for i, token in enumerate(dict.fromkeys(tokens))}
    model = {"type": "BPE", "end_of_word_suffix": WORD_END, "vocab": vocab, "merges": merges}
    return {"version": "1.0", "model": model, "added_tokens": []}


def write_clip(folder, inner="", side=16, vision=None, length="n", mask=False, crop=None):
    """The four files, the two networks in `inner`; vision: the path of another tower."""
    (folder / inner).mkdir(parents=True, exist_ok=True)
    written = tokenizer()
    (folder / "tokenizer.json").write_text(json.dumps(written))
    config = {
        "crop_size": crop if crop is not None else {"height": side, "width": side},
        "image_mean": [0.4, 0.5, 0.45], "image_std": [0.25, 0.2, 0.3], "do_normalize": True,
    }  # fmt: skip
    (folder / "preprocessor_config.json").write_text(json.dumps(config))
    if vision is None:
        write_color_tower(folder / inner / "vision_model.onnx", config)
    else:
        (folder / inner / "vision_model.onnx").write_bytes(vision.read_bytes())
    ids = written["model"]["vocab"]
    width = 3 if vision is None else 16
    table = np.tile(np.array(GREY), (len(ids), 1))
    for word, color in COLORS.items():
        table[ids[word + WORD_END]] = 1e4 * np.array(color)
    table[ids[START]] = 0
    table = table @ np.eye(3, width)
    write_text_tower(folder / inner / "text_model.onnx", table, length, mask, ids[END])
    return folder


def write_color_tower(path, config) -> None:
    """The mean colour of a picture, its normalisation undone."""
    mean, deviation = (np.array(config[k])[:, None, None] for k in ("image_mean", "image_std"))
    rows = [
        ("Mul", ["pixel_values", "deviation"], ["scaled"], {}),
        ("Add", ["scaled", "mean"], ["colors"], {}),
        ("GlobalAveragePool", ["colors"], ["pooled"], {}),
        ("Flatten", ["pooled"], ["image_embeds"], {"axis": 1}),
    ]
    shape = {"pixel_values": ["batch", 3, "height", "width"]}
    write_model(path, rows, shape, ["image_embeds"], {"mean": mean, "deviation": deviation})


def write_text_tower(path, table, length, mask, end) -> None:
    """The mean of the tokens' rows, of all that are no end."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    nodes = [
        helper.make_node("Gather", ["table", "input_ids"], ["rows"]),
        helper.make_node("Equal", ["input_ids", "end"], ["ends"]),
        helper.make_node("Not", ["ends"], ["words"]),
        helper.make_node("Cast", ["words"], ["counted"], to=1),
        helper.make_node("Unsqueeze", ["counted", "last"], ["weights"]),
        helper.make_node("Mul", ["rows", "weights"], ["kept"]),
        helper.make_node("ReduceSum", ["kept", "first"], ["text_embeds"], keepdims=0),
    ]
    stored = {
        "table": table.astype(np.float32), "end": np.array(end), "last": np.array([2]),
        "first": np.array([1]),
    }  # fmt: skip
    given = ["input_ids", "attention_mask"][: 1 + mask]
    graph = helper.make_graph(
        nodes, "text",
        [helper.make_tensor_value_info(n, TensorProto.INT64, ["b", length]) for n in given],
        [helper.make_tensor_value_info("text_embeds", TensorProto.FLOAT, None)],
        [numpy_helper.from_array(v, n) for n, v in stored.items()],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, path)


def write_clip_with_transformer(folder):
    """The same with a vision transformer of 32x32 pixels and 16 numbers."""
    folder.mkdir(exist_ok=True)
    tower = vision_transformer(folder / "tower.onnx")
    return write_clip(folder, side=32, vision=tower)

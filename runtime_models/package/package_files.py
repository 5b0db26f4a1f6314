"""The files of a package, out of a folder or a zip; sizes are checked before anything is read."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import channels_of
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.zip_files import is_zip, opened_zip, read_member
from shapeshift.runtime_models.model import AnchorModel, BadFile, Mlp

FORMAT = "shapeshift 1"
FRAMES_FORMAT = "shapeshift 2"  # the same, and anchors.npz holds the anchors' own frames
LIGHT_FORMAT = "shapeshift 3"  # and it holds their light by direction; frames or not
COLOR_LIGHT_FORMAT = "shapeshift 4"  # the same, of red, green and blue each
FORMATS = (FORMAT, FRAMES_FORMAT, LIGHT_FORMAT, COLOR_LIGHT_FORMAT)
LIT = {LIGHT_FORMAT: 1, COLOR_LIGHT_FORMAT: 3}  # channels of the anchors' light; of others none
MANIFEST = "scene.json"
ANCHORS = "anchors.npz"
LIGHT = "light"  # the array in it of the anchors' light, and the colour network's input
LABELS = "labels"  # the array in it that says which object each anchor is of
WHOLE = f"a package is {MANIFEST}, {ANCHORS} and five ONNX files"

LARGEST = {MANIFEST: 16 << 20, ANCHORS: 4 << 30}  # bytes, unpacked
LARGEST_NETWORK = 256 << 20  # bytes; five of 64 MB would draw one frame a minute


def format_name(model: AnchorModel) -> str:
    """What the manifest of its package names."""
    if model.light is not None:
        return LIGHT_FORMAT if channels_of(model.light) == LIT[LIGHT_FORMAT] else COLOR_LIGHT_FORMAT
    return FORMAT if model.frames is None else FRAMES_FORMAT


def open_package(path: Path, memory: Account) -> Callable[[str], bytes]:
    """read(name) -> bytes of one file of the package at `path`, charged.  Both raise BadFile."""
    if path.is_dir():
        return lambda name: read_from_folder(path, name, memory)
    if not is_zip(path):
        raise BadFile(f"{path} is not a package: it is no zip, or it is cut off; copy it again.")
    return lambda name: read_from_zip(path, name, memory)


def refuse_large(path: Path, name: str, size: int) -> None:
    limit = LARGEST.get(name, LARGEST_NETWORK)
    if size > limit:
        raise BadFile(f"{path}: {name} has {size:,} bytes, at most {limit:,} are read.")


def read_from_folder(path: Path, name: str, memory: Account) -> bytes:
    file = path / name
    if not file.is_file():
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    refuse_large(path, name, file.stat().st_size)
    memory.charge(file.stat().st_size, name)
    return file.read_bytes()


def read_from_zip(path: Path, name: str, memory: Account) -> bytes:
    """Nothing is unpacked to disk; the stated size bounds what is read, and the CRC is checked."""
    with opened_zip(path, str(path), memory) as archive:
        entry = find_entry(archive, path, name)
        refuse_large(path, name, entry.file_size)
        return read_member(archive, entry, str(path), memory)


def find_entry(archive: zipfile.ZipFile, path: Path, name: str) -> zipfile.ZipInfo:
    """At the top, or in the one folder that holds a manifest: zipping a folder keeps its name."""
    entries = archive.infolist()
    tops = {e.filename[: -len(MANIFEST)] for e in entries if e.filename.endswith(MANIFEST)}
    tops = {top for top in tops if top == "" or (top.count("/") == 1 and top.endswith("/"))}
    top = "" if "" in tops or len(tops) != 1 else tops.pop()
    found = [e for e in entries if e.filename == top + name]
    if not found:
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    if len(found) > 1:
        raise BadFile(f"{path} holds {name} {len(found)} times; write it again.")
    return found[0]


# A network to the bytes of an ONNX file that runs alone in onnxruntime on (N, inputs).

OPSET = 17
IR_VERSION = 8  # what opset 17 came with; older runtimes open it, too
HEAD_NODE = {"tanh": "Tanh", "sigmoid": "Sigmoid", "softplus": "Softplus", "exp": "Exp"}


def write_onnx(mlp: Mlp, name: str, first_bias: str = "stored") -> bytes:
    """Gemm, Relu, ..., Gemm, then Clip, the head and Mul where the network has them.

    With first_bias="input" the first layer's bias is not stored: it is a second input "bias" of the
    graph, (1, hidden) for all rows or (N, hidden).  "input and rows": and a third, "rows"
    (N, hidden), is added to the first layer, too.
    """
    from onnx import NodeProto, TensorProto, checker, helper, numpy_helper

    constants: list[TensorProto] = []
    nodes: list[NodeProto] = []

    def constant(label: str, value: np.ndarray | float) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, np.float32, order="C"), label))
        return label

    def apply(kind: str, *inputs: str, **attributes) -> str:
        nodes.append(helper.make_node(kind, inputs, [f"{kind}{len(nodes)}"], **attributes))
        return nodes[-1].output[0]

    value = "input"
    for i, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
        if i:
            value = apply("Relu", value)
        added = {"input": "bias", "input and rows": "rows"}.get(first_bias) if i == 0 else None
        label = added or constant(f"bias{i}", bias)
        value = apply("Gemm", value, constant(f"weight{i}", weight), label, transB=1)
        if added == "rows":
            value = apply("Add", value, "bias")
    if mlp.clip is not None:
        value = apply("Clip", value, constant("low", mlp.clip[0]), constant("high", mlp.clip[1]))
    if mlp.head != "none":
        value = apply(HEAD_NODE[mlp.head], value)
    if mlp.gain != 1.0:
        value = apply("Mul", value, constant("gain", mlp.gain))
    nodes[-1].output[0] = "output"

    def shaped(label: str, *shape):
        return helper.make_tensor_value_info(label, TensorProto.FLOAT, shape)

    inputs = [shaped("input", "N", mlp.width_in)]
    if first_bias != "stored":
        inputs.append(shaped("bias", "biases", len(mlp.biases[0])))
    if first_bias == "input and rows":
        inputs.append(shaped("rows", "N", len(mlp.biases[0])))
    graph = helper.make_graph(
        nodes, name, inputs, [shaped("output", "N", mlp.width_out)], constants
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR_VERSION
    checker.check_model(model)
    return model.SerializeToString()

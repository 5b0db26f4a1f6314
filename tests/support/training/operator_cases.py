"""One small network an operator, and the same function as numpy calculates it on complex numbers.

The complex numbers are for the complex step: the imaginary part of f(x + ih) / h is the derivative
of f to the last digit, by a formula that knows nothing of ONNX.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import erf

RNG = np.random.default_rng


def normal(*shape, seed=0):
    return RNG(seed).normal(size=shape)


def ints(*values):
    return np.array(values, np.int64)


@dataclass
class Case:
    rows: list  # nodes; the picture is "x", the result "y"
    formula: object  # the same of a complex array
    shape: tuple = (2, 3, 4)
    constants: dict = field(default_factory=dict)
    low: float = -2.0  # of the numbers in x
    high: float = 2.0
    opset: int = 17


def row(op, *inputs, out="y", **attributes):
    return (op, list(inputs), [out], attributes)


def one(op, formula, *inputs, shape=(2, 3, 4), low=-2.0, high=2.0, opset=17, more=(), **attributes):
    """A case of one node; `more` are its constants."""
    node = row(op, "x", *inputs, **attributes)
    return Case([node], formula, shape, dict(more), low, high, opset)


def unfolded(x, kernel, strides=(1, 1), pads=(0, 0, 0, 0), fill=0.0, dilations=(1, 1)):
    """(n, c, oh, ow, kh, kw): the windows of a picture."""
    widths = ((0, 0), (0, 0), (pads[0], pads[2]), (pads[1], pads[3]))
    x = np.pad(x, widths, constant_values=fill)
    reach = [(k - 1) * d + 1 for k, d in zip(kernel, dilations, strict=True)]
    all_windows = np.lib.stride_tricks.sliding_window_view(x, reach, axis=(2, 3))
    picked = all_windows[:, :, :: strides[0], :: strides[1]]
    return picked[..., :: dilations[0], :: dilations[1]]


def conv(x, w, group=1, **how):
    windows = unfolded(x, w.shape[2:], **how)
    parts = np.split(windows, group, axis=1)
    filters = np.split(w, group)
    sums = [np.einsum("nchwij,ocij->nohw", p, f) for p, f in zip(parts, filters, strict=True)]
    return np.concatenate(sums, axis=1)


def largest(windows):
    """By the real part, the first one of equals."""
    flat = windows.reshape(*windows.shape[:4], -1)
    best = np.argmax(flat.real, axis=-1)[..., None]
    return np.take_along_axis(flat, best, -1)[..., 0]


def soft(x, axes):
    e = np.exp(x - x.real.max(axis=axes, keepdims=True))
    return e / e.sum(axis=axes, keepdims=True)


def normed(x, axes, scale, shift, epsilon=1e-5):
    away = x - x.mean(axis=axes, keepdims=True)
    return away / np.sqrt((away**2).mean(axis=axes, keepdims=True) + epsilon) * scale + shift


W3, W1 = normal(5, 3, 3, 3), normal(4, 1, 3, 3)
ROW, COLUMN, STACK = normal(4), 1.5 + RNG(1).random((3, 1)), normal(5, 1, 3, 4)
PICTURE, SAME = (1, 3, 7, 6), {"kernel_shape": [3, 3]}
VARIANCE = np.abs(normal(3)) + 0.5

CASES = {
    "Abs": one("Abs", lambda x: np.where(x.real < 0, -x, x)),
    "Add": one("Add", lambda x: x + STACK, "b", more={"b": STACK}),
    "Add, the picture broadcast": Case(
        [row("Add", "b", "x")], lambda x: STACK + x, (3, 1), {"b": STACK}
    ),
    "Add, to itself": Case([row("Add", "x", "x")], lambda x: x + x),
    "AveragePool": one(
        "AveragePool", lambda x: unfolded(x, (2, 2), (2, 2)).mean((-1, -2)), shape=(1, 3, 7, 6),
        kernel_shape=[2, 2], strides=[2, 2],
    ),
    "AveragePool, padded": one(
        "AveragePool", lambda x: unfolded(x, (3, 3), (2, 2), (1, 1, 1, 1)).mean((-1, -2)),
        shape=PICTURE, pads=[1, 1, 1, 1], strides=[2, 2], count_include_pad=1, **SAME,
    ),
    "AveragePool, of what is inside": one(
        "AveragePool",
        lambda x: (
            unfolded(x, (3, 3), (1, 1), (1, 1, 1, 1)).sum((-1, -2))
            / unfolded(np.ones(PICTURE), (3, 3), (1, 1), (1, 1, 1, 1)).sum((-1, -2))
        ),
        shape=PICTURE, pads=[1, 1, 1, 1], **SAME,
    ),
    "BatchNormalization": one(
        "BatchNormalization",
        lambda x: (
            (x - normal(3, seed=3)[:, None]) / np.sqrt(VARIANCE + 1e-5)[:, None]
            * normal(3, seed=1)[:, None] + normal(3, seed=2)[:, None]
        ),
        "s", "b", "m", "v",
        more={"s": normal(3, seed=1), "b": normal(3, seed=2), "m": normal(3, seed=3),
              "v": VARIANCE},
    ),
    "Cast": one("Cast", lambda x: x, to=1),
    "Clip": one("Clip", lambda x: np.where(abs(x.real) > 1, np.sign(x.real), x), "l", "h",
                more={"l": np.array(-1.0), "h": np.array(1.0)}),
    "Clip, below alone": one("Clip", lambda x: np.where(x.real < 0.5, 0.5, x), "l",
                             more={"l": np.array(0.5)}),
    "Concat": Case([row("Concat", "x", "b", "x", axis=1)],
                   lambda x: np.concatenate([x, normal(2, 5, 4), x], 1),
                   constants={"b": normal(2, 5, 4)}),
    "Conv": one("Conv", lambda x: conv(x, W3, pads=(1, 1, 1, 1)), "w", shape=PICTURE,
                more={"w": W3}, pads=[1, 1, 1, 1], **SAME),
    "Conv, strides": one("Conv", lambda x: conv(x, W3, strides=(2, 3)), "w", shape=(1, 3, 8, 8),
                         more={"w": W3}, strides=[2, 3], **SAME),
    "Conv, dilations": one("Conv", lambda x: conv(x, W3, dilations=(2, 1), pads=(2, 1, 2, 1)), "w",
                           shape=PICTURE, more={"w": W3}, dilations=[2, 1], pads=[2, 1, 2, 1],
                           **SAME),
    "Conv, groups": one("Conv", lambda x: conv(x, W1, group=4), "w", shape=(1, 4, 5, 5),
                        more={"w": W1}, group=4, **SAME),
    "Conv, more padding than kernel": one(
        "Conv", lambda x: conv(x, W3, pads=(3, 3, 3, 3)), "w", shape=(1, 3, 4, 4), more={"w": W3},
        pads=[3, 3, 3, 3], **SAME,
    ),
    "Conv, padded by itself": one(
        "Conv", lambda x: conv(x, W3, strides=(2, 2), pads=(0, 0, 1, 1)), "w", shape=(1, 3, 6, 6),
        more={"w": W3}, strides=[2, 2], auto_pad="SAME_UPPER", **SAME,
    ),
    "Div": one("Div", lambda x: x / COLUMN, "b", more={"b": COLUMN}),
    "Div, by the picture": Case([row("Div", "b", "x")], lambda x: STACK / x, constants={"b": STACK},
                                low=0.5),
    "Dropout": one("Dropout", lambda x: x),
    "Erf": one("Erf", erf),
    "Exp": one("Exp", np.exp),
    "Expand": one("Expand", lambda x: x + np.zeros((5, 2, 3, 4)), "s", shape=(3, 1),
                  more={"s": ints(5, 2, 3, 4)}),
    "Flatten": one("Flatten", lambda x: x.reshape(6, 4), axis=2),
    "Gather": one("Gather", lambda x: x[:, 1], "i", more={"i": np.array(1)}, axis=1),
    "Gather, from the end": one("Gather", lambda x: x[..., -1], "i",
                                more={"i": np.array(-1)}, axis=2),
    "Gather, rows twice": one("Gather", lambda x: x[:, [2, 0, 2, 2]], "i",
                              more={"i": ints(2, 0, 2, 2)}, axis=1),
    "Gather, a table of rows": one("Gather", lambda x: x[np.array([[1, 0], [1, 1]])], "i",
                                   more={"i": np.array([[1, 0], [1, 1]])}),
    "Gelu": one("Gelu", lambda x: x * (1 + erf(x / np.sqrt(2))) / 2, opset=20),
    "Gemm": one("Gemm", lambda x: 0.5 * x @ normal(6, 5) + normal(5, seed=1), "w", "b",
                shape=(4, 6), more={"w": normal(6, 5), "b": normal(5, seed=1)}, alpha=0.5),
    "Gemm, transB": one("Gemm", lambda x: x @ normal(5, 6).T, "w", shape=(4, 6),
                        more={"w": normal(5, 6)}, transB=1),
    "GlobalAveragePool": one("GlobalAveragePool", lambda x: x.mean((2, 3), keepdims=True),
                             shape=PICTURE),
    "Identity": one("Identity", lambda x: x),
    "LayerNormalization": one(
        "LayerNormalization", lambda x: normed(x, (2,), ROW, normal(4, seed=1)), "s", "b",
        more={"s": ROW, "b": normal(4, seed=1)},
    ),
    "LayerNormalization, two axes": one(
        "LayerNormalization", lambda x: normed(x, (1, 2), normal(3, 4), 0, 0.1), "s",
        more={"s": normal(3, 4)}, axis=1, epsilon=0.1,
    ),
    "LeakyRelu": one("LeakyRelu", lambda x: np.where(x.real < 0, 0.2 * x, x), alpha=0.2),
    "Log": one("Log", np.log, low=0.3),
    "MatMul": one("MatMul", lambda x: x @ normal(4, 5), "w", more={"w": normal(4, 5)}),
    "MatMul, from the left": Case([row("MatMul", "w", "x")], lambda x: normal(5, 1, 6, 3) @ x,
                                  constants={"w": normal(5, 1, 6, 3)}),
    "MatMul, by itself": Case(
        [row("Transpose", "x", out="t", perm=[0, 2, 1]), row("MatMul", "x", "t")],
        lambda x: x @ x.swapaxes(1, 2),
    ),
    "MaxPool": one("MaxPool", lambda x: largest(unfolded(x, (2, 2), (2, 2))), shape=(2, 3, 7, 6),
                   kernel_shape=[2, 2], strides=[2, 2]),
    "MaxPool, overlapping": one(
        "MaxPool", lambda x: largest(unfolded(x, (3, 3), (2, 2), (1, 1, 1, 1), -9)),
        shape=(2, 3, 7, 6), strides=[2, 2], pads=[1, 1, 1, 1], **SAME,
    ),
    "Mul": one("Mul", lambda x: x * COLUMN, "b", more={"b": COLUMN}),
    "Mul, by itself": Case([row("Mul", "x", "x")], lambda x: x * x),
    "Neg": one("Neg", np.negative),
    "Pad": one("Pad", lambda x: np.pad(x, ((0, 0), (2, 1), (0, 3)), constant_values=7), "p", "v",
               more={"p": ints(0, 2, 0, 0, 1, 3), "v": np.array(7.0)}),
    "Pow": one("Pow", lambda x: x**2.5, "n", more={"n": np.array(2.5)}, low=0.2),
    "Pow, squares of any sign": one("Pow", lambda x: x**2, "n", more={"n": np.array(2.0)}),
    "Reciprocal": one("Reciprocal", lambda x: 1 / x, low=0.4),
    "ReduceL2": one("ReduceL2", lambda x: np.sqrt((x**2).sum(-1, keepdims=True)), axes=[-1]),
    "ReduceMean": one("ReduceMean", lambda x: x.mean((0, 2)), axes=[0, 2], keepdims=0),
    "ReduceMean, of all": one("ReduceMean", lambda x: x.mean()[None], keepdims=0),
    "ReduceMean, version 18": one("ReduceMean", lambda x: x.mean(1), "a", more={"a": ints(1)},
                                  keepdims=0, opset=18),
    "ReduceSum": one("ReduceSum", lambda x: x.sum(1, keepdims=True), "a", more={"a": ints(-2)}),
    "Relu": one("Relu", lambda x: np.where(x.real > 0, x, 0)),
    "Reshape": one("Reshape", lambda x: x.reshape(4, 6), "s", more={"s": ints(-1, 6)}),
    "Sigmoid": one("Sigmoid", lambda x: 1 / (1 + np.exp(-x))),
    "Slice": one("Slice", lambda x: x[:, 1:3], "s", "e", "a",
                 more={"s": ints(1), "e": ints(99), "a": ints(1)}),
    "Slice, backwards": one("Slice", lambda x: x[..., ::-2], "s", "e", "a", "t",
                            more={"s": ints(-1), "e": ints(-1 << 62), "a": ints(2), "t": ints(-2)}),
    "Slice, two axes": one("Slice", lambda x: x[:, 1:, :-1], "s", "e", "a",
                           more={"s": ints(1, 0), "e": ints(9, -1), "a": ints(1, 2)}),
    "Softmax": one("Softmax", lambda x: soft(x, (1,)), axis=1),
    "Softmax, version 11": one("Softmax", lambda x: soft(x, (1, 2)), opset=11),
    "Split": Case(
        [("Split", ["x", "s"], ["y", "z"], {"axis": 2})], lambda x: x[..., :3],
        constants={"s": ints(3, 1)},
    ),
    "Split, both parts": Case(
        [("Split", ["x"], ["a", "b"], {"axis": 2}), row("Mul", "a", "b")],
        lambda x: x[..., :2] * x[..., 2:], opset=13,
    ),
    "Sqrt": one("Sqrt", np.sqrt, low=0.3),
    "Squeeze": one("Squeeze", lambda x: x[:, 0], "a", shape=(2, 1, 4), more={"a": ints(1)}),
    "Sub": one("Sub", lambda x: x - ROW, "b", more={"b": ROW}),
    "Sub, the picture taken off": Case([row("Sub", "b", "x")], lambda x: STACK - x, (3, 4),
                                       {"b": STACK}),
    "Tanh": one("Tanh", np.tanh),
    "Transpose": one("Transpose", lambda x: x.transpose(2, 0, 1), perm=[2, 0, 1]),
    "Transpose, turned about": one("Transpose", lambda x: x.T),
    "Unsqueeze": one("Unsqueeze", lambda x: x[:, None], "a", more={"a": ints(1)}),
    "Where": one("Where", lambda x: np.where(normal(3, 4) > 0, x, 1), "one",
                 more={"one": np.array(1.0), "c": normal(3, 4) > 0}),
    "Where, by the picture": Case(
        [row("Greater", "x", "limit", out="c"), row("Where", "c", "limit", "x")],
        lambda x: np.where(x.real > 0.5, 0.5, x), constants={"limit": np.array(0.5)},
    ),
}  # fmt: skip
CASES["Where"].rows[0][1][:] = ["c", "x", "one"]

"""Networks on the CPU: onnxruntime sessions of ONNX bytes."""

import os

BATCH = 16384  # rows a run: bounds the memory; half and twice as many are no faster


def load_onnxruntime():
    """The package, which would otherwise tell its maker of every session, over the network."""
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    import onnxruntime

    return onnxruntime


def open_session(data: bytes | str, threads: int):
    """An onnxruntime session on the CPU of an ONNX file: its bytes, or its path."""
    onnxruntime = load_onnxruntime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads  # 1 measured fastest for these small networks
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])

"""Networks on the CPU: onnxruntime sessions of ONNX bytes."""

BATCH = 16384  # rows a run: bounds the memory; half and twice as many are no faster


def open_session(data: bytes, threads: int):
    """An onnxruntime session on the CPU of an ONNX file's bytes."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads  # 1 measured fastest for these small networks
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])

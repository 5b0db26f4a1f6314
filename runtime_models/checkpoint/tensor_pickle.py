"""The pickle in a torch archive, walked opcode by opcode: tensors come out, nothing is ever called.

Python's own unpickler imports and calls what a file names.  Here a name is a pair of words: a few
of them describe tensors, every other one is refused.
"""

import pickletools
from dataclasses import dataclass, field
from typing import Any

from shapeshift.runtime_models.model import BadFile

MOST_OPCODES = 200_000  # a network of a thousand layers has 30,000
MOST_NODES = 20_000  # of the finished tree, shared parts counted every time they are met
MOST_DEPTH = 64
LONGEST_NAME = 1000  # characters
LARGEST_KEY = 1 << 31  # of a dictionary whose keys are numbers
MODULE = "__torch__"  # what TorchScript puts before the classes of its modules

ITEM = {
    "FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "BFloat16Storage": "bf16",
    "LongStorage": "<i8", "IntStorage": "<i4", "ShortStorage": "<i2", "CharStorage": "i1",
    "ByteStorage": "u1", "BoolStorage": "?",
}  # fmt: skip
REBUILT = ("_rebuild_tensor", "_rebuild_tensor_v2")
LISTS = ("build_intlist", "build_doublelist", "build_boollist", "build_tensorlist")
TAKEN = {
    ("collections", "OrderedDict"), ("torch", "Size"), ("torch._utils", "_rebuild_parameter"),
    ("torch.jit._pickle", "restore_type_tag"),
    *(("torch", name) for name in ITEM),
    *(("torch._utils", name) for name in REBUILT),
    *(("torch.jit._pickle", name) for name in LISTS),
}  # fmt: skip


@dataclass(frozen=True)
class Name:
    """A GLOBAL of the file: two words, never looked up."""

    module: str
    name: str


@dataclass(frozen=True)
class Storage:
    """Numbers side by side in one member of the archive."""

    item: str  # one of ITEM's values
    key: str  # the member is data/KEY
    count: int


@dataclass(frozen=True)
class Tensor:
    """A view of a storage, as the file states it: not checked yet."""

    storage: Storage
    offset: int  # numbers
    size: tuple[int, ...]
    stride: tuple[int, ...]  # numbers


@dataclass
class ScriptModule:
    """A module of TorchScript: what it is called ("Linear"), what it holds by name."""

    kind: str = ""
    fields: dict = field(default_factory=dict)


@dataclass
class Index:
    """What a pickle holds, by dotted names ("0.weight")."""

    tensors: dict[str, Tensor] = field(default_factory=dict)
    modules: dict[str, str] = field(default_factory=dict)  # of TorchScript: what each is called


class _Mark:
    """Where a tuple, list or dictionary begins on the stack."""


MARK = _Mark()


def index_of(data: bytes, file: str) -> Index:
    """Every tensor and module of a pickle.  Raises BadFile."""
    machine = _Machine(file)
    try:
        for count, (opcode, given, _) in enumerate(pickletools.genops(data)):
            if count >= MOST_OPCODES:
                raise BadFile(f"{file}: its index has more than {MOST_OPCODES:,} steps; too many.")
            machine.run(opcode.name, given)
    except BadFile:
        raise
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError):
        raise BadFile(f"{file}: its index of tensors is damaged; save it again.") from None
    found = Index()
    _name_parts(machine.result, found, file)
    return found


def _name_parts(tree: object, found: Index, file: str) -> None:
    """Fills `found`; a tree whose shared parts would unfold without end is refused."""
    todo, nodes = [("", tree, 0)], 0
    while todo:
        name, node, depth = todo.pop()
        nodes += 1
        if nodes > MOST_NODES or depth > MOST_DEPTH or len(name) > LONGEST_NAME:
            raise BadFile(f"{file}: its tensors are nested or named beyond reason; save it again.")
        if isinstance(node, Tensor):
            found.tensors[name] = node
            continue
        if isinstance(node, ScriptModule):
            found.modules[name] = node.kind
            node = node.fields
        inside: list[tuple[object, object]] = []
        if isinstance(node, dict):
            inside = list(node.items())
        elif isinstance(node, list | tuple):
            inside = list(enumerate(node))
        if len(inside) + nodes + len(todo) > MOST_NODES:
            raise BadFile(f"{file}: its tensors are nested or named beyond reason; save it again.")
        below = [(f"{name}.{key}" if name else str(key), part) for key, part in inside]
        todo += [(*one, depth + 1) for one in reversed(below)]


class _Machine:
    """The stack that a pickle program works on."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.stack: list = []
        self.memo: dict[int, object] = {}
        self.result: object = None

    def run(self, name: str, given: Any) -> None:
        """One opcode.  Raises BadFile by name for one that tensors do not need."""
        stack, memo = self.stack, self.memo
        if name in CONSTANTS:
            stack.append(CONSTANTS[name])
        elif name in VALUES:
            if isinstance(given, int) and given.bit_length() > 64:
                raise ValueError("no number of a tensor is as large")
            stack.append(given)
        elif name in EMPTY:
            stack.append(EMPTY[name]())
        elif name in ("BINPUT", "LONG_BINPUT", "PUT"):
            memo[given] = stack[-1]
        elif name == "MEMOIZE":
            memo[len(memo)] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET", "GET"):
            stack.append(memo[given])
        elif name in STEPS:
            STEPS[name](self)
        elif name == "GLOBAL":
            stack.append(self._named(*given.split(" ", 1)))
        elif name == "STOP":
            (self.result,) = stack
        elif name not in ("PROTO", "FRAME"):
            raise BadFile(
                f"{self.file}: its index uses {name}, which tensors do not need; not read."
            )

    def _named(self, module: str, name: str) -> Name:
        inert = (module == MODULE or module.startswith(MODULE + ".")) and name.isidentifier()
        if not inert and (module, name) not in TAKEN:
            label = f"{module}.{name}"[:80]
            raise BadFile(
                f"{self.file} names {label!r}, and only tensors are read, nothing is ever run; "
                "save the networks alone (torch.jit.save, or a state dict by torch.save)."
            )
        return Name(module, name)

    def _stack_global(self) -> None:
        name, module = self.stack.pop(), self.stack.pop()
        if not (isinstance(name, str) and isinstance(module, str)):
            raise TypeError("a name is two strings")
        self.stack.append(self._named(module, name))

    def _since_mark(self) -> list:
        """What lies above the topmost mark, which goes as well."""
        stack = self.stack
        at = len(stack) - 1
        while stack[at] is not MARK:
            at -= 1
            if at < 0:
                raise IndexError("no mark")
        items = stack[at + 1 :]
        del stack[at:]
        return items

    def _tuple_of(self, count: int) -> None:
        items = self.stack[len(self.stack) - count :]
        if len(items) != count:
            raise IndexError("too few for a tuple")
        self.stack[len(self.stack) - count :] = [tuple(items)]

    def _set_items(self, items: list) -> None:
        target = self.stack[-1]
        if type(target) is not dict or len(items) % 2:
            raise TypeError("items go into a dictionary, in pairs")
        for key, value in zip(items[::2], items[1::2], strict=True):
            # Other keys can be made to hash slowly, or all alike.
            if not (type(key) is str or (type(key) is int and abs(key) < LARGEST_KEY)):
                raise TypeError("a key is a name or a small number")
            target[key] = value

    def _append(self, items: list) -> None:
        if type(self.stack[-1]) is not list:
            raise TypeError("items go into a list")
        self.stack[-1].extend(items)

    def _persistent(self) -> None:
        word, kind, key, _place, count = self.stack.pop()
        item = ITEM[kind.name] if isinstance(kind, Name) and kind.module == "torch" else None
        if word != "storage" or item is None or type(key) is not str or type(count) is not int:
            raise ValueError("no storage")
        self.stack.append(Storage(item, key, count))

    def _new_object(self) -> None:
        given, kind = self.stack.pop(), self.stack.pop()
        if given != () or not isinstance(kind, Name) or not kind.module.startswith(MODULE):
            raise ValueError("only TorchScript's modules are objects")
        self.stack.append(ScriptModule(kind.name))

    def _build(self) -> None:
        """State goes into a module once; of a dictionary (a state dict's _metadata) it is left."""
        state, target = self.stack.pop(), self.stack[-1]
        if isinstance(target, ScriptModule) and type(state) is dict and not target.fields:
            target.fields = state
        elif type(target) is not dict:
            raise ValueError("only modules have a state")

    def _reduce(self) -> None:
        """Never a call: what the few known names stand for."""
        given, kind = self.stack.pop(), self.stack.pop()
        if not isinstance(kind, Name) or type(given) is not tuple:
            raise ValueError("nothing that could be made")
        if kind.name == "OrderedDict" and not given:
            self.stack.append({})
        elif kind.name in REBUILT:
            self.stack.append(_tensor(*given[:4]))
        elif kind.name in ("_rebuild_parameter", "restore_type_tag", "Size", *LISTS):
            self.stack.append(given[0])
        else:
            raise ValueError(f"a {kind.name} is not made like this")


def _tensor(storage: object, offset: object, size: object, stride: object) -> Tensor:
    if not (isinstance(storage, Storage) and isinstance(size, tuple) and isinstance(stride, tuple)):
        raise ValueError("no tensor")
    whole = [offset, *size, *stride]
    if not all(type(number) is int and number >= 0 for number in whole) or len(size) != len(stride):
        raise ValueError("no tensor")
    assert isinstance(offset, int)  # as has just been seen
    return Tensor(storage, offset, size, stride)


CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": (), "MARK": MARK}
EMPTY = {"EMPTY_DICT": dict, "EMPTY_LIST": list}
VALUES = {
    "BININT", "BININT1", "BININT2", "LONG1", "LONG4", "INT", "LONG", "BINFLOAT", "FLOAT",
    "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "UNICODE", "BINSTRING", "SHORT_BINSTRING",
    "STRING", "BINBYTES", "SHORT_BINBYTES",
}  # fmt: skip
STEPS = {
    "TUPLE": lambda m: m.stack.append(tuple(m._since_mark())),
    "TUPLE1": lambda m: m._tuple_of(1),
    "TUPLE2": lambda m: m._tuple_of(2),
    "TUPLE3": lambda m: m._tuple_of(3),
    "LIST": lambda m: m.stack.append(m._since_mark()),
    "APPEND": lambda m: m._append([m.stack.pop()]),
    "APPENDS": lambda m: m._append(m._since_mark()),
    "SETITEM": lambda m: m._set_items([m.stack.pop(-2), m.stack.pop()]),
    "SETITEMS": lambda m: m._set_items(m._since_mark()),
    "POP": lambda m: m.stack.pop(),
    "BINPERSID": _Machine._persistent,
    "STACK_GLOBAL": _Machine._stack_global,
    "NEWOBJ": _Machine._new_object,
    "BUILD": _Machine._build,
    "REDUCE": _Machine._reduce,
}

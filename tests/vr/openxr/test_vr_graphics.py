"""What a runtime is told of our GL context, in fields of any pointer type; what it refuses."""

import ctypes
from types import SimpleNamespace

import pytest

from shapeshift.vr.openxr.graphics import _need, _set_pointer
from shapeshift.vr.openxr.instance import NoHeadset


class Base(ctypes.Structure):
    _fields_ = (("next", ctypes.c_void_p),)


class Binding(Base):
    _fields_ = (
        ("display", ctypes.POINTER(ctypes.c_int)),  # as Xlib's and EGL's
        ("h_dc", ctypes.c_void_p),  # as Windows'
    )


@pytest.mark.parametrize("name", ["next", "display", "h_dc"])
@pytest.mark.parametrize("value", [0x7F00_1234_5678, None])
def test_a_handle_arrives_in_any_kind_of_field(name, value):
    binding = Binding()
    _set_pointer(binding, name, value)
    field = getattr(binding, name)
    found = (
        field
        if field is None or isinstance(field, int)
        else ctypes.cast(field, ctypes.c_void_p).value
    )
    assert found == value


def test_a_context_that_the_runtime_does_not_take_is_one_sentence():
    instance = SimpleNamespace(runtime="the OpenXR runtime Testing 1.0", extensions=("XR_A",))
    assert _need(instance, "XR_A", "a GLX")
    for kind, cure in (("an EGL", "start it where a window can be opened"), ("a GLX", "SteamVR")):
        with pytest.raises(NoHeadset, match=f"Testing 1.0 takes no pictures of {kind}.*{cure}"):
            _need(instance, "XR_MNDX_egl_enable", kind)

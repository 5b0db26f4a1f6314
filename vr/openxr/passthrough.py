"""The room itself below our pictures, as a vendor's runtime shows it (XR_FB_passthrough): a layer
of its own, where there is no environment blend mode for it.
"""

from typing import Any

from shapeshift.vr.openxr.instance import PASSTHROUGH, Instance


class Passthrough:
    """Off until a frame shows it; `there`: whether it can.  Close before the session ends.

    wanted: False where the runtime blends pictures by their alpha, which needs none of this.
    """

    def __init__(self, instance: Instance, session: Any, wanted: bool) -> None:
        self._xr, self._session = instance.xr, session
        self._feature: Any | None = None
        self._layer: Any | None = None
        self._runs = False
        if wanted and PASSTHROUGH in instance.extensions:
            self._open()

    @property
    def there(self) -> bool:
        return self._layer is not None

    def _open(self) -> None:
        """Both handles, or none where the headset has no such cameras or the user forbids them."""
        xr = self._xr
        try:
            self._feature = xr.create_passthrough_fb(self._session, xr.PassthroughCreateInfoFB())
            info = xr.PassthroughLayerCreateInfoFB(
                self._feature, xr.PassthroughFlagsFB.NONE,
                xr.PassthroughLayerPurposeFB.RECONSTRUCTION,
            )  # fmt: skip
            self._layer = xr.create_passthrough_layer_fb(self._session, info)
        except xr.exception.ErrorResult:
            self.close()

    def layer(self, shown: bool) -> Any | None:
        """What a frame puts below all other layers; the cameras rest where it is not shown."""
        if not self.there:
            return None
        if shown != self._runs:
            self._switch(shown)
        if not (self._runs and self.there):
            return None
        return self._xr.CompositionLayerPassthroughFB(layer_handle=self._layer)

    def _switch(self, on: bool) -> None:
        """A runtime that no longer can is asked no more."""
        xr = self._xr
        try:
            if on:
                xr.passthrough_start_fb(self._feature)
                xr.passthrough_layer_resume_fb(self._layer)
            else:
                xr.passthrough_layer_pause_fb(self._layer)
                xr.passthrough_pause_fb(self._feature)
            self._runs = on
        except xr.exception.ErrorResult:
            self.close()

    def changed(self, flags: int) -> None:
        """After an event of the runtime's: it wants another one, or has none any more."""
        states = self._xr.PassthroughStateChangedFlagsFB
        if not self.there:
            return
        if flags & int(states.NON_RECOVERABLE_ERROR_BIT):
            self.close()
        elif flags & int(states.REINIT_REQUIRED_BIT):
            self.close()
            self._open()

    def close(self) -> None:
        """Gives both back, also what was lost with the runtime."""
        xr = self._xr
        layer, feature = self._layer, self._feature
        self._layer = self._feature = None
        self._runs = False
        for handle, end in (
            (layer, xr.destroy_passthrough_layer_fb), (feature, xr.destroy_passthrough_fb),
        ):  # fmt: skip
            try:
                if handle is not None:
                    end(handle)
            except xr.exception.ErrorResult:
                pass

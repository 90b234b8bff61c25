"""The history of views: where the camera has been, apart from the undo of edits."""
from rtcore.camera import Camera

MOST_VIEWS = 200


class ViewHistory:
    """A list of cameras with a place in it, like a browser's. Moves of one gesture make one step, not hundreds."""

    def __init__(self):
        self._views: list[Camera] = []
        self._at = -1
        self._gesture: object = None

    def start(self, camera: Camera):
        """Forget all and begin with this view."""
        self._views, self._at, self._gesture = [camera], 0, None

    def visit(self, camera: Camera, gesture: object = None):
        """The camera moved here. Moves in a row with the same `gesture` (anything but None) overwrite one another."""
        if self._at >= 0 and camera == self._views[self._at]:
            return
        del self._views[self._at + 1:]
        if gesture is not None and gesture == self._gesture and self._at > 0:
            self._views[self._at] = camera
        else:
            self._views.append(camera)
            del self._views[:-MOST_VIEWS]
            self._at = len(self._views) - 1
        self._gesture = gesture

    @property
    def can_back(self) -> bool:
        return self._at > 0

    @property
    def can_forward(self) -> bool:
        return self._at + 1 < len(self._views)

    def back(self) -> Camera:
        """The view before this one, or this one if there is none."""
        return self._go(-1 if self.can_back else 0)

    def forward(self) -> Camera:
        """The view that `back` left, or this one if there is none."""
        return self._go(1 if self.can_forward else 0)

    def _go(self, step: int) -> Camera:
        self._at += step
        self._gesture = None
        return self._views[self._at]

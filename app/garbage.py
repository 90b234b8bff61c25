"""Python's garbage collector, kept from stopping the window.

It looks for cycles through all objects there are, now and then, with Python's lock held: half a million objects that the compiler's
modules and a scene consist of took it 80 to 190 ms. They live as long as the program or the scene, so they are set aside each time that
there are more of them, and a collection looks only at what came since, in some milliseconds.
"""
import gc

from PySide6.QtCore import QObject, Slot

from app.filing import Filing
from app.session import Session


class Garbage(QObject):
    """While modules and files are loaded nothing is collected; what there is then, and what the first picture brought, is set aside."""

    def __init__(self, session: Session, filing: Filing):
        super().__init__(filing)
        self._session, self._filing = session, filing
        self._settled = False
        gc.disable()
        filing.loading_changed.connect(self._loading)
        session.document.replaced.connect(self._replaced)
        session.frame_changed.connect(self._frame)

    @Slot()
    def _loading(self):
        if self._filing.loading is not None:
            gc.disable()
        else:
            settle()

    @Slot()
    def _replaced(self):
        self._settled = False

    @Slot()
    def _frame(self):
        if not self._settled and self._session.shown.frame.samples:
            self._settled = True
            settle()


def settle():
    """Set aside what lives now, and collect as usual from now on."""
    gc.freeze()
    gc.collect()        # of next to nothing; from its count Python works out when to look through all the next time
    gc.enable()

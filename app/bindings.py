"""A field of a record tied to the widget that edits it, both ways, without feedback loops.

The model speaks by `refresh`, which shows its value and never emits. The widget speaks by its signals, which only a
person sets off. A value that the record can't take is shown as refused, with the reason, and goes no further.
"""
import itertools
from collections.abc import Callable

from PySide6.QtCore import QObject, Slot

from app.editors import Editor
from rtcore.fields import FieldError

_numbers = itertools.count()


def same(a: object, b: object) -> bool:
    """Whether two values of a field surely look alike. A record that is made anew has its vectors anew; long lists are not compared."""
    return a is b or (type(a) is type(b) and isinstance(a, (bool, int, float, str, tuple)) and
                      not (isinstance(a, tuple) and len(a) > 16) and a == b)


class Binding(QObject):
    """Ties `editor` to a value of a model.

    read() -> the value as the model has it
    make(value) -> what the model would become; raises FieldError where it can't
    commit(made, merge) -> take it; edits of one drag share `merge`. May raise FieldError as well
    seal() -> the drag is over
    """

    def __init__(self, editor: Editor, read: Callable[[], object], make: Callable[[object], object],
                 commit: Callable[[object, object], None], seal: Callable[[], None]):
        super().__init__(editor)
        self._editor, self._read, self._make, self._commit, self._seal = editor, read, make, commit, seal
        self._merge = ("binding", next(_numbers))
        self._speaking = False
        self._shown: object = self              # the value that the editor shows for sure; the binding itself: none
        editor.tried.connect(self._try)
        editor.edited.connect(self._edit)
        editor.released.connect(self._release)
        self.refresh()

    def refresh(self):
        """Show the model's value, unless this very editor is setting it, or shows just that: of a node's 25 editors an edit changes one."""
        if not self._speaking and not same(value := self._read(), self._shown):
            self._editor.show_value(value)
            self._shown = value

    @Slot(object)
    def _try(self, value: object):
        self._shown = self
        try:
            self._make(value)
        except FieldError as error:
            self._editor.refuse(str(error))
        else:
            self._editor.refuse(None)

    @Slot(object, bool)
    def _edit(self, value: object, dragging: bool):
        self._speaking, self._shown = True, self
        try:
            self._commit(self._make(value), self._merge if dragging else None)
        except FieldError as error:
            self._editor.refuse(str(error))
        else:
            self._editor.refuse(None)
            self._editor.show_value(self._read())
        finally:
            self._speaking = False

    @Slot()
    def _release(self):
        self._shown = self
        self._seal()

"""The stability report made in helper processes: one measures, another draws; the window only follows their lines."""
import os
import shutil
import sys
import time
from pathlib import Path

import platformdirs
from PySide6.QtCore import QObject, QProcess, QProcessEnvironment, Signal, Slot

import rtcore

HELPER = (sys.executable, "-u", "-m", "rtcore.reports.stability")
DRAWER = (sys.executable, "-u", "-m", "app.plots")
ENOUGH = 0.03       # the share that has to be done before the time left can be told


def report_folder() -> Path:
    """Where the latest report is kept, in the user's data folder."""
    return platformdirs.user_data_path("rayscope") / "stability"


class Measuring(QObject):
    """Runs the helpers one after the other. `folder` holds the last report that was finished; a run that is stopped or fails leaves it."""

    progressed = Signal(float, str, object)     # share done, what is being done, seconds left or None
    ended = Signal(str)                         # a complaint of one line; empty: there is a new report

    def __init__(self, folder: Path | None = None, helper: tuple[str, ...] = HELPER, parent: QObject | None = None):
        super().__init__(parent)
        self.folder = folder or report_folder()
        self._helper = helper
        self._process: QProcess | None = None
        self._drawing = False
        self._complaint = ""
        self._started = 0.0
        self._stopping = False

    @property
    def running(self) -> bool:
        return self._process is not None

    @property
    def _fresh(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}-{os.getpid()}")

    def start(self, quick: bool, shape: str | None = None):
        """Measure all shapes, or one."""
        if self.running:
            return
        try:
            shutil.rmtree(self._fresh, ignore_errors=True)
            self._fresh.mkdir(parents=True)
        except OSError as error:
            self.ended.emit(f"{self._fresh}: {(error.strerror or 'failed').lower()}")
            return
        self._stopping, self._drawing, self._started = False, False, time.monotonic()
        self._run([*self._helper, str(self._fresh), *(["--quick"] if quick else []), *(["--shape", shape] if shape else [])])

    def stop(self):
        """End the helper, and wait for its end."""
        if self._process is not None:
            self._stopping = True
            self._process.kill()
            if self._process is not None:
                self._process.waitForFinished(1000)

    def _run(self, command: list[str]):
        process = self._process = QProcess(self)
        environment = QProcessEnvironment.systemEnvironment()
        places = [str(Path(rtcore.__file__).parent.parent), *filter(None, [environment.value("PYTHONPATH")])]
        environment.insert("PYTHONPATH", os.pathsep.join(places))
        if self._drawing:
            environment.insert("QT_QPA_PLATFORM", "offscreen")
        process.setProcessEnvironment(environment)
        process.setProcessChannelMode(QProcess.ProcessChannelMode.MergedChannels)
        process.readyReadStandardOutput.connect(self._read)
        process.finished.connect(self._finished)
        process.errorOccurred.connect(self._failed)
        self._complaint = ""
        process.start(command[0], command[1:])

    @Slot()
    def _read(self):
        while self._process is not None and self._process.canReadLine():
            line = bytes(self._process.readLine()).decode(errors="replace").strip()
            done, total, what = (line.split(maxsplit=2) + ["", "", ""])[:3]
            if self._drawing:
                self.progressed.emit(1.0, "drawing the plots", None)
            elif done.isdigit() and total.isdigit() and int(total):
                share = min(int(done) / int(total), 1.0)
                passed = time.monotonic() - self._started
                self.progressed.emit(share, what, passed * (1 - share) / share if share > ENOUGH else None)
            if line and not done.isdigit():
                self._complaint = line

    @Slot(int, QProcess.ExitStatus)
    def _finished(self, code: int, status: QProcess.ExitStatus):
        self._read()
        self._process.deleteLater()
        self._process = None
        measured = (self._fresh / "stability.csv").is_file() and code in (0, 1)     # 1: a target is missed
        if self._stopping:
            self._end("stopped")
        elif status == QProcess.ExitStatus.CrashExit or not measured or (self._drawing and code != 0):
            self._end(self._complaint or f"the helper ended with exit code {code}")
        elif not self._drawing:
            self._drawing = True
            self.progressed.emit(1.0, "drawing the plots", None)
            self._run([*DRAWER, str(self._fresh)])
        else:
            self._end("")

    @Slot(QProcess.ProcessError)
    def _failed(self, error: QProcess.ProcessError):
        if error == QProcess.ProcessError.FailedToStart:
            complaint = self._process.errorString()
            self._process.deleteLater()
            self._process = None
            self._end(complaint)

    def _end(self, complaint: str):
        """Put the new report in the old one's place, or throw away what there is of it."""
        try:
            if not complaint:
                shutil.rmtree(self.folder, ignore_errors=True)
                os.replace(self._fresh, self.folder)
            shutil.rmtree(self._fresh, ignore_errors=True)
        except OSError as error:
            complaint = f"{self.folder}: {(error.strerror or 'failed').lower()}"
        self.ended.emit(complaint)

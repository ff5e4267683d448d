import io
import re

import pytest

from throwcollect.cli.terminal import _Bar, display
from throwcollect.coordinator.progress import Progress


def progress(ended: int, **outcomes: int) -> Progress:
    return Progress(total=10, ended=ended, outcomes=outcomes, simulations=2, throws_per_s=3.14, hung=[])


def test_the_progress_counts_failed_and_lost_trials() -> None:
    assert progress(3, landed=3).counts == "3 landed, 0 failed, 2 simulations, 3.1 throws/s"
    assert progress(6, landed=3, self_hit=1, timeout=1, lost=1).counts == (
        "3 landed, 2 failed, 1 lost, 2 simulations, 3.1 throws/s"
    )


def test_progress_lines_are_printed_at_intervals_and_once_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    with display(quiet=False) as shown:
        for ended in (1, 2, 3, 10, 10, 10):
            shown.update(progress(ended, landed=ended))
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["1/10", "10/10"]


def test_quiet_shows_only_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    with display(quiet=True) as shown:
        shown.say("plan: 10 trials")
        shown.update(progress(10, landed=10))
        shown.warn("sim_0 was lost")
    assert capsys.readouterr().err == "sim_0 was lost\n"


@pytest.mark.parametrize(("columns", "cells"), [(200, 40), (90, 18), (60, 4)])
def test_the_progress_bar_fits_the_present_width_of_the_terminal_on_one_line(columns: int, cells: int) -> None:
    shown = _Bar()
    console = shown._progress.console
    console.width = 80
    shown.update(progress(1, landed=1))
    console.width = columns
    shown.update(progress(3, landed=1, self_hit=1, lost=1))
    assert shown._bar.bar_width == cells
    (line,) = console.render_lines(shown._progress.get_renderable())
    text = "".join(segment.text for segment in line)
    assert re.search(r" 3/10 1 landed.* ETA [-\d]+:[-\d]+", text)


class Terminal(io.StringIO):
    """A terminal that breaks its lines when it gets narrower, as most do; `rows` is what it shows."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self._width, self._wraps = width, True
        self._row, self._column, self._saved = 0, 0, (0, 0)
        self.rows = [""]

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        for code, character in re.findall(r"(\x1b(?:\[[?\d;]*\w|[78]))|(.)", text, flags=re.DOTALL):
            self._obey(code) if code else self._put(character)
        return len(text)

    def _put(self, character: str) -> None:
        if character in "\r\n":
            self._column = 0
            self._row += character == "\n"
        else:
            if self._column == self._width:
                self._row, self._column = (self._row + 1, 0) if self._wraps else (self._row, self._width - 1)
            self.rows.extend([""] * (self._row + 1 - len(self.rows)))
            row = self.rows[self._row].ljust(self._column)
            self.rows[self._row] = row[: self._column] + character + row[self._column + 1 :]
            self._column += 1
        self.rows.extend([""] * (self._row + 1 - len(self.rows)))

    def _obey(self, code: str) -> None:
        match code.removeprefix("\x1b"):
            case "[2K":
                self.rows[self._row] = ""
            case "[J":
                self.rows[self._row :] = [self.rows[self._row][: self._column]]
            case "[1A":
                self._row = max(self._row - 1, 0)
            case "[B":
                self._row = min(self._row + 1, len(self.rows) - 1)
            case "7":
                self._saved = self._row, self._column
            case "8":
                self._row, self._column = self._saved
                self.rows.extend([""] * (self._row + 1 - len(self.rows)))
            case "[?7l" | "[?7h":
                self._wraps = code.endswith("h")
            case other:
                assert other[-1] == "m" or other in ("[?25l", "[?25h"), other

    def narrow(self, width: int) -> None:
        broken = [re.findall(f".{{1,{width}}}", row) or [""] for row in self.rows]
        self._row = sum(map(len, broken[: self._row])) + self._column // width
        self._column, self._width = self._column % width, width
        self.rows = [part for parts in broken for part in parts]


@pytest.mark.parametrize("told", [True, False])
def test_narrowing_the_terminal_leaves_no_remains_of_the_progress_bar(
    monkeypatch: pytest.MonkeyPatch, told: bool
) -> None:
    terminal = Terminal(120)
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    shown = _Bar()
    console = shown._progress.console
    console.width, shown._live.auto_refresh = 120, False
    with shown:
        shown.say("plan: 10 trials")
        shown.update(progress(1, landed=1))
        shown._live.refresh()
        assert [row[:4] for row in terminal.rows] == ["plan", "━━━━"]
        terminal.narrow(40)
        if not told:
            shown._live.refresh()
        console.width = 40
        shown.update(progress(2, landed=2))
        shown.warn("sim_0 was lost")
    assert [row.strip(" ━╸╺")[:8] for row in terminal.rows] == ["plan: 10", "sim_0 wa", "2/10 2 l", ""]

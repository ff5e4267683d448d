import pytest

from throwcollect.cli.terminal import _Bar, display
from throwcollect.coordinator.progress import Progress


def progress(ended: int, **outcomes: int) -> Progress:
    return Progress(total=10, ended=ended, outcomes=outcomes, simulations=2, throws_per_s=3.14, hung=[])


def test_counts_tell_failures_and_losses() -> None:
    assert progress(3, landed=3).counts == "3 landed, 0 failed, 2 simulations, 3.1 throws/s"
    assert progress(6, landed=3, self_hit=1, timeout=1, lost=1).counts == (
        "3 landed, 2 failed, 1 lost, 2 simulations, 3.1 throws/s"
    )


def test_lines_come_now_and_then_and_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    with display(quiet=False) as shown:
        for ended in (1, 2, 3, 10, 10, 10):
            shown.update(progress(ended, landed=ended))
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["1/10", "10/10"]


def test_who_wants_quiet_hears_warnings_only(capsys: pytest.CaptureFixture[str]) -> None:
    with display(quiet=True) as shown:
        shown.say("plan: 10 trials")
        shown.update(progress(10, landed=10))
        shown.warn("sim_0 was lost")
    assert capsys.readouterr().err == "sim_0 was lost\n"


@pytest.mark.parametrize(("columns", "cells"), [(200, 40), (90, 18), (60, 4)])
def test_the_bar_fits_the_terminal_as_it_is_now_and_no_text_takes_a_second_line(columns: int, cells: int) -> None:
    shown = _Bar()
    console = shown._progress.console
    console.width = 80
    shown.update(progress(1, landed=1))
    console.width = columns
    shown.update(progress(3, landed=1, self_hit=1, lost=1))
    assert shown._bar.bar_width == cells
    assert len(console.render_lines(shown._progress.get_renderable())) == 1

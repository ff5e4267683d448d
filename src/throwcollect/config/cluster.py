"""Keys for collections on a cluster: what a batch script asks of the scheduler, and how a task begins."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, PositiveInt

from throwcollect.config.kinds import NUMBER_AS_TEXT, in_words, match
from throwcollect.config.section import Section


def _require_line(text: str) -> str:
    if not text.isprintable():
        raise ValueError(f"should be one line of printable characters, got {text!r}")
    return text


_TIME = r"\d+|\d+:\d{1,2}(:\d{1,2})?|\d+-\d{1,2}(:\d{1,2}){0,2}"
Time = Annotated[
    str,
    NUMBER_AS_TEXT,
    match(_TIME, "minutes, HOURS:MINUTES:SECONDS or DAYS-HOURS, such as 4:00:00"),
    in_words("a time such as 4:00:00"),
]
Memory = Annotated[
    str, match(r"[1-9]\d*[KMGT]", "a number and K, M, G or T, such as 4G"), in_words("a size such as 4G")
]
Word = Annotated[str, match(r"[!-~]+", "one word without blanks"), in_words("one word")]
Line = Annotated[str, AfterValidator(_require_line)]
Scratch = Annotated[
    str,
    match(r"[/$][A-Za-z0-9_./${}-]*", "an absolute path or begin with a variable, such as $TMPDIR"),
    in_words("a directory such as `$TMPDIR`"),
]
Bind = Annotated[
    Line,
    match(r"/[^:,]*(:/[^:,]*(:r[ow])?)?", "DIRECTORY or DIRECTORY:INSIDE[:ro] with absolute paths"),
    in_words("DIRECTORY[:INSIDE[:ro]]"),
]


class ClusterConfig(Section):
    """How a collection is run as an array of tasks of a scheduler; nothing in this section changes the dataset."""

    partition: Word | None = None
    """Partition that the tasks are queued in; null leaves the choice to the scheduler, here and in the next keys."""
    account: Word | None = None
    """Account that is charged."""
    qos: Word | None = None
    """Quality of service."""
    constraint: Word | None = None
    """Features that a node must have."""
    time: Time | None = None
    """Time limit of a task; shortly before it, the task shuts down properly, and is queued again (`requeue`)."""
    memory: Memory | None = None
    """Memory of a task."""
    cores: Annotated[int, Field(ge=1, le=256)] = 1
    """Cores of a task, which runs one simulation on each."""
    at_once: PositiveInt | None = None
    """Largest number of tasks that run at the same time."""
    modules: list[Word] = []
    """Environment modules that a task loads."""
    lines: list[Line] = []
    """Further lines that the site needs at the start of the batch script: `#SBATCH` options and commands."""
    image: str | None = None
    """Image of Apptainer that tasks run in (`make sif`); null takes the Python environment from which
    the collection is submitted, which all nodes have to see."""
    binds: list[Bind] = []
    """Further directories that tasks see inside the image; they always see the directory of the dataset."""
    scratch: Scratch | None = None
    """Directory on a disk of the node, such as `$TMPDIR`, in which a task collects before it hands its slice over."""
    requeue: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often a task that was stopped, and has shut down properly, is queued again."""

"""Keys for collections on a cluster: what the scheduler is asked for, and what a task begins with."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, PositiveInt, WithJsonSchema

from throwcollect.config.section import Section


def _minutes(value: object) -> object:
    """A number of minutes, as YAML has it, as text."""
    return str(value) if type(value) is int else value


def _time(text: str) -> str:
    if not re.fullmatch(r"\d+|\d+:\d{1,2}(:\d{1,2})?|\d+-\d{1,2}(:\d{1,2}){0,2}", text):
        raise ValueError(f"should be minutes, HOURS:MINUTES:SECONDS or DAYS-HOURS, such as 4:00:00, got '{text}'")
    return text


def _memory(text: str) -> str:
    if not re.fullmatch(r"[1-9]\d*[KMGT]", text):
        raise ValueError(f"should be a number and K, M, G or T, such as 4G, got '{text}'")
    return text


def _word(text: str) -> str:
    if not re.fullmatch(r"[!-~]+", text):
        raise ValueError(f"should be one word without blanks, got '{text}'")
    return text


def _line(text: str) -> str:
    if not text.isprintable():
        raise ValueError(f"should be one line of printable characters, got {text!r}")
    return text


def _bind(text: str) -> str:
    if not re.fullmatch(r"/[^:,]*(:/[^:,]*(:r[ow])?)?", text) or not text.isprintable():
        raise ValueError(f"should be DIRECTORY or DIRECTORY:INSIDE[:ro] with absolute paths, got '{text}'")
    return text


def _scratch(text: str) -> str:
    if not re.fullmatch(r"[/$][A-Za-z0-9_./${}-]*", text):
        raise ValueError(f"should be an absolute path or begin with a variable, such as $TMPDIR, got '{text}'")
    return text


def _in_words(words: str) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "words": words})


Time = Annotated[str, BeforeValidator(_minutes), AfterValidator(_time), _in_words("a time such as 4:00:00")]
Memory = Annotated[str, AfterValidator(_memory), _in_words("a size such as 4G")]
Word = Annotated[str, AfterValidator(_word), _in_words("one word")]
Line = Annotated[str, AfterValidator(_line)]
Scratch = Annotated[str, AfterValidator(_scratch), _in_words("a directory such as `$TMPDIR`")]
Bind = Annotated[str, AfterValidator(_bind), _in_words("DIRECTORY[:INSIDE[:ro]]")]


class ClusterConfig(Section):
    """How a collection is run as an array of tasks of a scheduler; nothing in this section changes the dataset."""

    partition: Word | None = None
    """Partition that the tasks are queued in; null leaves this and the next ones to the scheduler."""
    account: Word | None = None
    """Account that is charged."""
    qos: Word | None = None
    """Quality of service."""
    constraint: Word | None = None
    """Features that a node must have."""
    time: Time | None = None
    """Time limit of a task; a task that comes near it stops in order, and is queued again (`requeue`)."""
    memory: Memory | None = None
    """Memory of a task."""
    cores: Annotated[int, Field(ge=1, le=256)] = 1
    """Cores of a task; it runs as many simulations."""
    at_once: PositiveInt | None = None
    """Largest number of tasks that run at the same time."""
    modules: list[Word] = []
    """Environment modules that a task loads."""
    lines: list[Line] = []
    """Lines of the site's own at the start of the batch script: `#SBATCH` options and commands."""
    image: str | None = None
    """Image of Apptainer that tasks run in (`throwcollect image sif`); null takes the Python environment that submits,
    which all nodes have to see."""
    binds: list[Bind] = []
    """Further directories that are seen in the image; that of the dataset always is."""
    scratch: Scratch | None = None
    """Directory on a disk of the node, such as `$TMPDIR`, in which a task collects before it hands its slice over."""
    requeue: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often a task that was stopped in order is queued again."""

"""Keys for collections on a cluster: what a batch script asks of the scheduler, and how a task begins."""

from typing import Annotated

from pydantic import Field, PositiveInt

from throwcollect.config.kinds import NUMBER_AS_TEXT
from throwcollect.config.section import Section

_TIME = r"^([0-9]+|[0-9]+:[0-9]{1,2}(:[0-9]{1,2})?|[0-9]+-[0-9]{1,2}(:[0-9]{1,2}){0,2})$"
Time = Annotated[str, NUMBER_AS_TEXT, Field(pattern=_TIME)]
Memory = Annotated[str, Field(pattern=r"^[1-9][0-9]*[KMGT]$")]
Word = Annotated[str, Field(pattern=r"^[!-~]+$")]
Line = Annotated[str, Field(pattern=r"^[^\p{Cc}\p{Zl}\p{Zp}]*$")]
Scratch = Annotated[str, Field(pattern=r"^[/$][A-Za-z0-9_./${}-]*$")]
Bind = Annotated[Line, Field(pattern=r"^/[^:,]*(:/[^:,]*(:r[ow])?)?$")]


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
    """Time limit of a task, such as `4:00:00`; shortly before it, the task shuts down properly, and is queued again
    (`requeue`)."""
    memory: Memory | None = None
    """Memory of a task, such as `4G`."""
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
    """Further directories that tasks see inside the image, as DIRECTORY[:INSIDE[:ro]]; they always see the directory of
    the dataset."""
    scratch: Scratch | None = None
    """Directory on a disk of the node, such as `$TMPDIR`, in which a task collects before it hands its slice over."""
    requeue: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often a task that was stopped, and has shut down properly, is queued again."""

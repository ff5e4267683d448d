"""Keys of every tool."""

from typing import ClassVar

from typing_extensions import Self

from throwcollect.config.section import Section


class ToolConfig(Section):
    """Base of the sections of tools; a member of the family ``tools`` is a class that is derived from it.

    Attributes:
        implementation: The tool itself, ``module:class``: a `Tool` that is made of a section of this class. It is
            imported where it is needed, so that reading a configuration stays cheap.
    """

    implementation: ClassVar[str]

    name: str
    """Tool model."""

    def __hash__(self) -> int:
        """Hash all keys, also lists and mappings that a tool may have."""
        return hash(self.model_dump_json())

    def without_release(self) -> Self:
        """Make a copy without the time of a release; tools whose copies are equal are loaded and checked only once."""
        return self

"""A wheel of ballpass holds the deriving half and needs the wheel of the other, ballpass-runtime, of its own version.

An editable installation has both halves in this repository and needs no other distribution.
"""

from __future__ import annotations

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class RuntimeOfThisVersion(BuildHookInterface):  # type: ignore[misc, type-arg]
    """Adds the dependency to wheels."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """`version` is "standard" or "editable"."""
        if version == "standard":
            build_data["dependencies"].append(f"ballpass-runtime=={self.metadata.version}")

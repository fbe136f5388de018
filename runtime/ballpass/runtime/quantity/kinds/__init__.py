"""Kinds of quantities, one file each: every `Kind` in a module's ``KINDS`` is known everywhere (`registry`)."""

"""The small campaign, for tests to break."""

from small_campaign import folder_with, texts, write_files

__all__ = ["folder_with", "texts", "write_files"]

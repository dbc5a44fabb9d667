"""What all reports share: words, numbers, style, tables."""

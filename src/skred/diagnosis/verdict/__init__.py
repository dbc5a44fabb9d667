"""Step 6: the verdict as a document and in words."""

"""The report of concealed trials."""

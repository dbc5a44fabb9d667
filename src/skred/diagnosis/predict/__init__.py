"""Step 5: avalanches that were held out, before and after."""

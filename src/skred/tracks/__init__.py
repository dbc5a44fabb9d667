"""From a terrain model and a line on the map to ``track.csv``: one step a file, all of them in `build`."""

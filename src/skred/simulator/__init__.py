"""Campaigns with concealed physics, from a simulator that shares no code with the models under test.

Fronts are integrated in time on smooth terrain (the models integrate along the track), what is hidden has
other shapes than the mechanisms' templates, and the only thing shared is the campaign format. `draw` makes a
trial from a seed.
"""

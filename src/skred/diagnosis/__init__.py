"""Where simulation and recordings differ, which physics was left out, and what it buys to add it."""

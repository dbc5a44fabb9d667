"""The model pack: one friction law a file, each a PyMC model and runnable by itself."""

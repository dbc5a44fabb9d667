"""The model discrepancy: a force that is in no list, as a Gaussian process along the track."""
